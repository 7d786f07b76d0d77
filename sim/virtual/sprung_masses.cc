#include "sim/virtual/sprung_masses.h"

#include <cmath>
#include <numbers>

#include "robot/kinematics.h"

namespace plumb {
namespace {

constexpr double kPointGyration = 1e-3;  // [m] no engine takes a point

Eigen::VectorXd ZeroPose(const RobotDescription& robot) {
  Eigen::VectorXd q = Eigen::VectorXd::Zero(robot.num_positions());
  for (int i = 0; i < robot.num_joints(); ++i) {
    if (robot.joints[static_cast<size_t>(i)].type == JointDescription::Type::kSpherical)
      q[robot.position_of(i)] = 1;
  }
  return q;
}

}  // namespace

RobotDescription WithSprungMasses(RobotDescription robot) {
  if (robot.virtual_robot.sprung_masses.empty()) return robot;
  const std::vector<Pose> poses = LinkPoses(robot, ZeroPose(robot));
  const Eigen::Vector3d gravity = robot.simulation.gravity * robot.virtual_robot.ground.Down();
  for (const SprungMass& sprung : robot.virtual_robot.sprung_masses) {
    const double rate = 2 * std::numbers::pi * sprung.frequency;
    const Eigen::Vector3d axis = poses[static_cast<size_t>(sprung.link)].rotation * sprung.axis;

    JointDescription joint;
    joint.name = sprung.name;
    joint.type = JointDescription::Type::kPrismatic;
    joint.parent = sprung.link;
    joint.child = static_cast<int>(robot.links.size());
    joint.origin = sprung.centre;
    joint.axis = sprung.axis;
    joint.lower = -sprung.travel;
    joint.upper = sprung.travel;
    joint.passive = true;
    joint.dynamics.stiffness = sprung.mass * rate * rate;
    joint.dynamics.damping = 2 * sprung.damping_ratio * sprung.mass * rate;
    joint.dynamics.rest = -gravity.dot(axis) / (rate * rate);  // so that gravity moves it to 0
    robot.joints.push_back(joint);

    LinkDescription link;
    link.name = sprung.name;
    link.mass = sprung.mass;
    link.inertia = sprung.mass * kPointGyration * kPointGyration * Eigen::Matrix3d::Identity();
    robot.links.push_back(link);
  }
  return robot;
}

}  // namespace plumb
