#include "sim/virtual/simbody_tree.h"

#include "robot/joint_tree.h"

namespace plumb {
namespace {

using Type = JointDescription::Type;

SimTK::Rotation ToSimbody(const Eigen::Matrix3d& m) {
  return SimTK::Rotation(SimTK::Mat33(m(0, 0), m(0, 1), m(0, 2), m(1, 0), m(1, 1), m(1, 2), m(2, 0),
                                      m(2, 1), m(2, 2)));
}

SimTK::MassProperties ToSimbody(const LinkDescription& link) {
  if (link.mass == 0) return {0, SimTK::Vec3(0), SimTK::Inertia(0)};
  const Eigen::Matrix3d& i = link.inertia;
  const SimTK::Inertia central(i(0, 0), i(1, 1), i(2, 2), i(0, 1), i(0, 2), i(1, 2));
  const SimTK::Vec3 center = plumb::ToSimbody(link.center_of_mass);
  return {link.mass, center, central.shiftFromMassCenter(-center, link.mass)};
}

/// Simbody turns about z and slides along x.
SimTK::MobilizedBody Attach(const JointDescription& joint, SimTK::MobilizedBody& parent,
                            const SimTK::Body::Rigid& body) {
  const SimTK::Vec3 origin = plumb::ToSimbody(joint.origin);
  if (joint.type == Type::kSpherical) {
    const SimTK::Transform inboard(ToSimbody(joint.rotation), origin);
    return SimTK::MobilizedBody::Ball(parent, inboard, body, SimTK::Transform());
  }
  const bool slides = joint.type == Type::kPrismatic;
  const SimTK::Rotation to_axis(
      SimTK::UnitVec3(plumb::ToSimbody(joint.axis)),
      slides ? SimTK::CoordinateAxis(SimTK::XAxis) : SimTK::CoordinateAxis(SimTK::ZAxis));
  const SimTK::Transform outboard(to_axis);
  const SimTK::Transform inboard(ToSimbody(joint.rotation) * to_axis, origin);
  if (slides) return SimTK::MobilizedBody::Slider(parent, inboard, body, outboard);
  return SimTK::MobilizedBody::Pin(parent, inboard, body, outboard);
}

}  // namespace

SimbodyTree::SimbodyTree(const RobotDescription& robot)
    : matter(system),
      forces(system),
      gravity(
          forces, matter,
          ToSimbody(Eigen::Vector3d(robot.simulation.gravity * robot.virtual_robot.ground.Down()))),
      efforts(forces, matter),
      links{matter.Ground()} {
  RequireTree(robot);
  for (size_t i = 0; i < robot.joints.size(); ++i) {
    const JointDescription& joint = robot.joints[i];
    const SimTK::Body::Rigid body(ToSimbody(robot.links[i + 1]));
    links.push_back(Attach(joint, links[static_cast<size_t>(joint.parent)], body));
  }
}

}  // namespace plumb
