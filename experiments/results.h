#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/name_lock.h"
#include "common/ranks.h"

namespace plumb {

/// The table of an experiment, a CSV file: what was asked for (a key of several columns) and the
/// numbers that came out, a row or more. Every job's rows are written at once and at once complete,
/// so that an interrupted experiment goes on with the next job. Where several ranks share the work
/// rank 0 alone reads and writes the file, and all of them know what is in it. Not thread-safe.
class Results {
 public:
  using Rows = std::vector<std::vector<double>>;

  /// Reads what is there; the table is this process's from now on.
  /// @param settings that all results depend on, in words: the first line, after a #.
  /// @param keys,values names of the columns. @param ranks must outlive this.
  /// @throws std::runtime_error if the file is no such table, or one of other settings, or another
  /// process is at work on it.
  Results(std::filesystem::path file, const std::string& settings, std::vector<std::string> keys,
          std::vector<std::string> values, const Ranks& ranks = Ranks::Alone());

  bool Has(const std::string& key) const { return index_.count(key) > 0; }
  /// @param key values of the key's columns, separated by commas. @throws std::out_of_range if
  /// there is none.
  const Rows& Of(const std::string& key) const { return groups_[index_.at(key)].second; }
  /// From now on the table has the rows of these keys in this order, whichever come first, behind
  /// those of others.
  void Arrange(const std::vector<std::string>& keys);
  /// Called by all ranks, in the same order. Numbers are rounded to the eight digits that the file
  /// has. @throws std::runtime_error if it cannot be written.
  void Add(const std::string& key, Rows rows);

  size_t values() const { return values_; }  ///< columns of Rows
  const Ranks& ranks() const { return ranks_; }

 private:
  std::filesystem::path file_;
  const Ranks& ranks_;
  std::optional<NameLock> lock_;
  size_t values_;
  std::string header_;
  std::vector<std::pair<std::string, Rows>> groups_;  // in the order in which they came
  std::map<std::string, size_t> index_;
  std::map<std::string, size_t> place_;  // of keys that are arranged, from 1
};

}  // namespace plumb
