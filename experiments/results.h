#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "common/name_lock.h"
#include "common/process.h"

namespace plumb {

/// The table of an experiment, a CSV file: what was asked for (a key of several columns) and the
/// numbers that came out, a row or more. Every job's rows are written at once and at once complete,
/// so that an interrupted experiment goes on with the next job. Not thread-safe.
class Results {
 public:
  using Rows = std::vector<std::vector<double>>;

  /// Reads what is there; the table is this process's from now on.
  /// @param settings that all results depend on, in words: the first line, after a #.
  /// @param keys,values names of the columns.
  /// @throws std::runtime_error if the file is no such table, or one of other settings, or another
  /// process is at work on it.
  Results(std::filesystem::path file, const std::string& settings, std::vector<std::string> keys,
          std::vector<std::string> values);

  bool Has(const std::string& key) const { return index_.count(key) > 0; }
  /// @param key values of the key's columns, separated by commas. @throws std::out_of_range if
  /// there is none.
  const Rows& Of(const std::string& key) const { return groups_[index_.at(key)].second; }
  /// @throws std::runtime_error if it cannot be written.
  void Add(const std::string& key, Rows rows);

 private:
  std::filesystem::path file_;
  NameLock lock_;
  std::string header_;
  std::vector<std::pair<std::string, Rows>> groups_;  // in the order in which they came
  std::map<std::string, size_t> index_;
};

/// One line of work of an experiment.
struct Job {
  std::string key;
  double weight;  ///< how long it takes, relative to the others
  /// @param progress to be told which share is done, now and then; throws when the process is to
  /// stop.
  std::function<Results::Rows(const std::function<void(double)>& progress)> run;
};

/// Does those jobs that the table does not have yet, and says on standard error how long it will
/// take.
/// @return false if the process was asked to stop before the end.
bool RunJobs(Process& process, const std::vector<Job>& jobs, Results& results);

}  // namespace plumb
