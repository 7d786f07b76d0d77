#pragma once

#include <algorithm>

#include "robot/parameter_kinds.h"

namespace plumb {

/// The effort [Nm or N] of a drive that runs a position loop of its own, at its own rate, between
/// commands: what is commanded on top of a spring about `rest` and a damper, as far as the motor
/// can make it,
///   clip(commanded + kp (rest - q) - kd v, -effort_limit, effort_limit).
/// A command for the position p is the effort kp (p - rest). Without gains, and of a passive joint,
/// it is what is commanded. What arrives at the joint is motor_gain times this. Thread-safe.
/// @param effort_limit [Nm or N] of the joint; 0 of a passive one.
inline double DriveEffort(const JointDynamics& joint, double effort_limit, double commanded,
                          double q, double v) {
  if (!(effort_limit > 0) || (joint.kp == 0 && joint.kd == 0)) return commanded;
  const double asked = commanded + joint.kp * (joint.rest - q) - joint.kd * v;
  return std::clamp(asked, -effort_limit, effort_limit);
}

}  // namespace plumb
