#pragma once

#include <limits>
#include <optional>

#include "robot/description.h"

namespace plumb {

/// The bounds of a joint; see JointDescription and JointLimitSettings. Thread-safe.
struct JointLimits {
  double lower, upper;  ///< [rad] or [m]; infinite for a continuous joint
  double velocity;      ///< [rad/s] or [m/s]; infinite = none
  double effort;        ///< [Nm] or [N]
  /// [rad] or [m] >= 0 within a position limit, where efforts towards it fade
  double margin = 0;
  double effort_rate = std::numeric_limits<double>::infinity();  ///< [Nm/s] or [N/s] > 0
};

inline JointLimits LimitsOf(const JointDescription& joint) {
  return {joint.lower,
          joint.upper,
          joint.velocity_limit,
          joint.effort_limit,
          joint.limits.position_margin,
          joint.limits.effort_rate};
}

/// The last part of the velocity limit, in which efforts that would make the joint faster fade.
inline constexpr double kVelocityBand = 0.05;

/// The state of a joint when its effort is chosen.
struct JointSituation {
  double position, velocity;  ///< measured
  double effort_sent;         ///< [Nm] or [N] the effort last sent
  double elapsed;             ///< [s] >= 0 since then
};

/// The effort that may be sent for the effort that is wished:
/// - at most the effort limit, either way;
/// - what is allowed towards a position limit falls linearly from the effort limit to zero within
///   `margin` before it; beyond the limit there is only what brings the joint back. Likewise for
///   what makes the joint faster, in the last kVelocityBand before the velocity limit;
/// - away from zero, it changes by at most effort_rate times the time since the effort last sent;
///   towards zero at once: a limit never keeps an effort on.
/// @return nothing if the wish, position or velocity is not finite.
std::optional<double> LimitEffort(double wish, const JointSituation& joint,
                                  const JointLimits& limits);

}  // namespace plumb
