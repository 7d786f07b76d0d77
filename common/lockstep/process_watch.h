#pragma once

#include <sys/types.h>

#include <chrono>
#include <string>

namespace plumb {

/// Looks from outside whether a process that is being waited for gets on: it may compute for
/// minutes, but not sleep. A debugger's and SIGSTOP's stops may last for ever. Real time. Not
/// thread-safe.
class ProcessWatch {
 public:
  explicit ProcessWatch(pid_t pid = 0) : pid_(pid) {}

  /// The wait begins.
  void Begin();
  /// For people: the reason for which the process keeps others waiting, now and then once it has
  /// been waited for long. Empty: nothing to say.
  std::string Look();
  /// Whether there is no such process any more; looks.
  bool dead() const;
  /// [s] for which it has neither computed nor been stopped.
  double idle() const;

 private:
  using Clock = std::chrono::steady_clock;

  pid_t pid_;
  long ticks_ = -1;  // of processor time at the last look
  Clock::time_point begin_ = Clock::now(), moved_ = begin_;
  double next_note_ = kFirstNote;
  static constexpr double kFirstNote = 5;  // [s] of waiting; then whenever it has doubled
};

}  // namespace plumb
