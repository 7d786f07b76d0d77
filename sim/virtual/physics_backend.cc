#include "sim/virtual/physics_backend.h"

#include <stdexcept>
#include <string>

namespace plumb {

void RequireHingesAndSlides(const RobotDescription& robot) {
  for (const JointDescription& joint : robot.joints) {
    if (joint.type == JointDescription::Type::kSpherical)
      throw std::invalid_argument("the free rotation of joint '" + joint.name + "'");
  }
}

void RequireKnownJoints(const RobotDescription& robot) {
  for (const JointDescription& joint : robot.joints) {
    const std::string of = " of joint '" + joint.name + "'";
    const JointParameterKind* unknown =
        FirstNotAmong({&JointDynamics::armature, &JointDynamics::damping, &JointDynamics::friction,
                       &JointDynamics::stiffness, &JointDynamics::rest, &JointDynamics::kp,
                       &JointDynamics::kd, &JointDynamics::motor_gain},
                      joint.dynamics);
    if (unknown) throw std::invalid_argument(unknown->noun + of);
  }
}

void RequireNoLinkContact(const RobotDescription& robot) {
  if (!robot.simulation.link_pairs.empty())
    throw std::invalid_argument("contact of links with each other or with shapes of the base");
}

void RequireState(const PhysicsBackend::Vector& q, const PhysicsBackend::Vector& v,
                  Eigen::Index positions, Eigen::Index velocities) {
  if (q.size() != positions || v.size() != velocities) {
    throw std::invalid_argument("a state has " + std::to_string(positions) + " positions and " +
                                std::to_string(velocities) + " velocities");
  }
  if (!q.allFinite() || !v.allFinite())
    throw std::invalid_argument("a robot's state must be finite");
}

}  // namespace plumb
