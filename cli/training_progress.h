#pragma once

#include <chrono>
#include <cstdint>
#include <fstream>
#include <string>

#include "common/progress_line.h"
#include "common/time_units.h"
#include "trainer/trainer.h"

// How a training goes, for people and their tables. Not thread-safe.
namespace plumb {

/// Real time since it was made.
class Stopwatch {
 public:
  double seconds() const { return SecondsSince(start_); }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// progress.csv, a line for each update. A resumed run keeps the lines up to where it goes on from.
class ProgressTable {
 public:
  /// @param file empty = none. @param updates to keep. @throws as WriteAtomically.
  ProgressTable(const std::string& file, int64_t updates);
  /// @param evaluation return; NaN = not evaluated. @param seconds since the start.
  /// @throws std::runtime_error if the line cannot be written.
  void Add(const Trainer& trainer, const UpdateReport& report, double evaluation, double seconds);

 private:
  std::string file_;
  std::ofstream stream_;
};

/// One line that is written over where people look at it; into a file, a line now and then.
class TrainingProgress {
 public:
  /// @param speaks false: shows nothing.
  explicit TrainingProgress(bool speaks) : speaks_(speaks), line_(speaks) {}
  ~TrainingProgress() { line_.Keep(); }
  /// @param steps of the whole training. @param done_before steps of earlier runs.
  void Show(const Trainer& trainer, const UpdateReport& report, int64_t steps, int64_t done_before);

 private:
  bool speaks_;
  ProgressLine line_;
  double next_ = 0;  // [s] before it the line stays as it is
  Stopwatch clock_;
};

}  // namespace plumb
