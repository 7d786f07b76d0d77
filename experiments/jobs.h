#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "common/process.h"
#include "experiments/results.h"

namespace plumb {

/// One line of work of an experiment.
struct Job {
  std::string key;
  double weight;  ///< how long it takes, relative to the others
  /// Jobs of one group remember things for each other, and those of another take as long: a rank
  /// does whole groups, as long as there are enough of them.
  int group;
  /// @param progress to be told which share is done, now and then; throws when the process is to
  /// stop.
  std::function<Results::Rows(const std::function<void(double)>& progress)> run;
};

/// Does those jobs that the table does not have yet, and says on standard error how long it will
/// take. Several ranks share them, and all of them end with the whole table. Called by all ranks
/// with the same jobs; the rows do not depend on their number.
/// @return what this process is to end with: 130 if it was asked to stop before the end, 0 if it is
/// a rank that has no more to do; nothing if it is the one that draws the results.
std::optional<int> RunJobs(Process& process, const std::vector<Job>& jobs, Results& results);

}  // namespace plumb
