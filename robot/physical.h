#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "robot/description.h"

namespace plumb {

// What a robot can be, do or feel, so generously that nothing real is refused and so strictly that
// squares and products of it are finite. What is beyond comes from a broken sensor, a forged
// message or a damaged file, and is refused where it comes in: a single such number ruins every
// filter and every sum that it enters. Functions here are thread-safe.

/// Of positions, velocities, accelerations and efforts: [rad] or [m], per s, per s^2, [Nm] or [N].
inline constexpr double kGreatestQuantity = 1e9;
/// Of a parameter, its mean and its standard deviation, in any unit.
inline constexpr double kGreatestParameter = 1e12;
/// No reading is surer.
inline constexpr double kLeastSd = 1e-12;
/// An effort so many times the strongest motor's limit is none of this robot's; a log may have been
/// recorded when limits were higher.
inline constexpr double kOverload = 10;

/// [us] No clock gets there; beyond it, differences overflow.
inline constexpr int64_t kLatestTime = int64_t{1} << 53;

/// Of a utime [us].
inline bool IsTime(int64_t utime) { return utime >= -kLatestTime && utime <= kLatestTime; }
/// False of what is not finite.
inline bool IsPhysical(double x) { return std::abs(x) <= kGreatestQuantity; }
/// 0 = exact.
inline bool IsPhysicalSd(double sd) {
  return sd == 0 || (sd >= kLeastSd && sd <= kGreatestQuantity);
}

/// [Nm] or [N] that an effort on any of the robot's joints may have.
inline double GreatestEffort(const RobotDescription& robot) {
  double greatest = 0;
  for (const JointDescription& joint : robot.joints)
    greatest = std::max(greatest, joint.effort_limit);
  return std::min(kOverload * greatest, kGreatestQuantity);
}

}  // namespace plumb
