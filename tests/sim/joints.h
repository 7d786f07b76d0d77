#pragma once

#include <numbers>
#include <string>

#include "common/special_numbers.h"
#include "tests/sim/robots.h"

/// Robots as far as tasks know them: joints without bodies.
namespace plumb {

using Type = JointDescription::Type;
inline constexpr double kPi = std::numbers::pi;

inline JointDescription Joint(const std::string& name, JointDescription::Type type, double lower,
                              double upper, double effort_limit) {
  JointDescription joint = LoadPendulum("robot.toml").joints[0];
  joint.name = name;
  joint.type = type;
  joint.lower = lower;
  joint.upper = upper;
  joint.effort_limit = effort_limit;
  joint.passive = effort_limit == 0;
  return joint;
}

inline RobotDescription CartAndPole(const std::string& task) {
  RobotDescription description = LoadPendulum("robot.toml");
  description.task = {task, 0.02, 500};
  description.joints = {Joint("slide", Type::kPrismatic, -2, 2, 10),
                        Joint("hinge", Type::kContinuous, -kInfinity, kInfinity, 0)};
  return description;
}

}  // namespace plumb
