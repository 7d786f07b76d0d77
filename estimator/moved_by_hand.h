#pragma once

#include <algorithm>
#include <cmath>

namespace plumb {

/// Whether somebody has evidently moved the robot: a reading lies further from what was expected
/// than it may by rights, and than its doubt explains.
/// @param away from what was expected. A NaN is no evidence.
/// @param reset_after as in EstimatorSettings, in the same unit.
/// @param sd of `away`, the reading's and what was expected. Thread-safe.
inline bool MovedByHand(double away, double reset_after, double sd) {
  constexpr double kSurely = 5;  // standard deviations
  return std::abs(away) > std::max(reset_after, kSurely * sd);
}

}  // namespace plumb
