#pragma once

#include <optional>

#include "robot/description.h"

namespace plumb {

/// What a joint must not exceed; see JointDescription.
struct JointLimits {
  double lower, upper;  ///< [rad] or [m]; infinite for a continuous joint
  double velocity;      ///< [rad/s] or [m/s]
  double effort;        ///< [Nm] or [N]
};

inline JointLimits LimitsOf(const JointDescription& joint) {
  return {joint.lower, joint.upper, joint.velocity_limit, joint.effort_limit};
}

/// The effort that may be sent for the effort that is wished at a measured position and velocity: clamped to
/// the effort limit; beyond a position or velocity limit only what brings the joint back.
/// @return nothing if any of the three is not finite.
std::optional<double> LimitEffort(double effort, double position, double velocity, const JointLimits& limits);

}  // namespace plumb
