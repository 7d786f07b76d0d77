#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "robot/description.h"
#include "robot/parameter_distribution.h"
#include "trainer/evaluation.h"

namespace plumb {

/// An update's line of the table that `plumb train --csv` writes.
struct TrainingRow {
  double update, steps, mean_return, evaluation_return, kl, surrogate_gain, explained_variance,
      entropy, accepted, dropped_episodes, seconds;
};

/// @throws std::runtime_error with file and line where it is no such table. Thread-safe.
std::vector<TrainingRow> ReadTrainingRows(const std::string& file);

/// What a training has come to.
struct TrainingOutcome {
  std::string command, distribution;  ///< the distribution's name, as it was given
  int64_t from = 0;                   ///< the update whose policy was chosen
  int64_t updates = 0, steps = 0;
  uint64_t seed = 0;
  double seconds = 0;  ///< real time
  bool chosen = true;  ///< false: the last policy, whatever the others were
  /// without exploration, on simulators held out: of the distribution, of the prior
  Evaluation own, on_prior;
};

/// How a training went, for people: a page of HTML that loads nothing. Thread-safe.
std::string TrainingReport(const RobotDescription& robot, const ParameterDistribution& distribution,
                           const TrainingOutcome& outcome, const std::vector<TrainingRow>& rows);

}  // namespace plumb
