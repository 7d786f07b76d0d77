#pragma once

#include <string>
#include <vector>

#include "common/config.h"

namespace plumb {

struct JointDescription;
struct LinkDescription;

/// [task].
struct TaskSettings {
  std::string name;  ///< file name in sim/tasks/
  double period;     ///< [s] control period
  int steps;         ///< per episode
  /// Tasks reach, hold and balance: where to go and how far around it an episode may begin; one
  /// each per coordinate of q.
  std::vector<double> target = {}, spread = {};
  /// Task balance: how far from the target the robot has fallen; likewise, 0 = never.
  std::vector<double> fall = {};
  /// Task walk: forward, to the left [m/s], turning to the left [rad/s], in the robot's heading.
  std::vector<double> velocity = {0, 0, 0};
};

/// @param links on which what fixed joints fix hangs. Thread-safe. @throws ConfigError
TaskSettings ReadTask(Config config, const std::vector<JointDescription>& joints,
                      const std::vector<LinkDescription>& links);

}  // namespace plumb
