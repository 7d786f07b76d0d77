#pragma once

#include <span>
#include <string>
#include <vector>

#include "calibrator/motion/transitions.h"

namespace plumb {

/// A robot's motion as one file has recorded it. Readers: lcm_log.h and csv_log.h. Plain data: not
/// thread-safe.
struct Log {
  std::string name;               ///< the file
  std::vector<Rollout> rollouts;  ///< each with at least one transition, in the file's order
  DropCounts drops;
  /// for people: parts of the file that could not be used, what is doubtful, what was assumed
  std::vector<std::string> warnings;
  /// joints whose velocities are but differences of their positions: DifferencedJoints
  std::vector<std::string> differenced = {};
};

/// Of all logs, in their order.
inline std::vector<Rollout> RolloutsOf(std::span<const Log> logs) {
  std::vector<Rollout> rollouts;
  for (const Log& log : logs)
    rollouts.insert(rollouts.end(), log.rollouts.begin(), log.rollouts.end());
  return rollouts;
}

}  // namespace plumb
