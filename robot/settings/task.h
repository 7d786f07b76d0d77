#pragma once

#include <string>
#include <vector>

#include "common/config.h"

namespace plumb {

struct JointDescription;

/// [task].
struct TaskSettings {
  std::string name;  ///< file name in sim/tasks/
  double period;     ///< [s] control period
  int steps;         ///< per episode
  /// Tasks reach and hold: where to go and how far around it an episode may begin; one each per
  /// coordinate of q.
  std::vector<double> target = {}, spread = {};
};

/// Thread-safe. @throws ConfigError
TaskSettings ReadTask(Config config, const std::vector<JointDescription>& joints);

}  // namespace plumb
