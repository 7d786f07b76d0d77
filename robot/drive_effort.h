#pragma once

#include <algorithm>

#include "robot/parameter_kinds.h"

namespace plumb {

// A drive that runs a position loop of its own, at its own rate, between commands: a spring about
// `rest` and a damper, with what is commanded on top. A command for the position p is the effort
// kp (p - rest). Thread-safe.

/// What the loop asks of the motor [Nm or N]: commanded + kp (rest - q) - kd v. Real is double or a
/// pack.
template <class Real>
Real LoopEffort(const JointDynamicsOf<Real>& joint, const Real& commanded, const Real& q,
                const Real& v) {
  return commanded + joint.kp * (joint.rest - q) - joint.kd * v;
}

/// That, as far as the motor can make it: within +- effort_limit. Without gains, and of a passive
/// joint, it is what is commanded. What arrives at the joint is motor_gain times this.
/// @param effort_limit [Nm or N] of the joint; 0 of a passive one.
inline double DriveEffort(const JointDynamics& joint, double effort_limit, double commanded,
                          double q, double v) {
  if (!(effort_limit > 0) || (joint.kp == 0 && joint.kd == 0)) return commanded;
  return std::clamp(LoopEffort(joint, commanded, q, v), -effort_limit, effort_limit);
}

}  // namespace plumb
