#pragma once

#include <time.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>

namespace plumb {

/// The time of a run in virtual time, as one of its processes knows it [us]. Thread-safe.
struct VirtualTime {
  std::atomic<int64_t> now = 0;
  std::atomic<int64_t> error = 0;  ///< of the date: now + error
};

/// The time of a whole run. Real, or scaled: one factor lets a closed loop with a virtual robot run
/// faster (or slower) than real time, scaled = epoch + (real - epoch) * scale; every process of a
/// run is given the same scale and epoch (flag `--clock SCALE@EPOCH`). Or virtual: it stands still
/// while a process works (docs/virtual-time.md). All times are int64 microseconds. Thread-safe
/// (immutable).
class Clock {
 public:
  /// @param scale scaled seconds per real second, in (0, 1000].
  /// @param epoch real CLOCK_REALTIME microseconds at which scaled and real time agree.
  /// @throws std::invalid_argument if scale is out of range.
  explicit Clock(double scale = 1, int64_t epoch = 0);
  /// The virtual time of a run: Participant::time(). Utime and Now are the same, unless somebody
  /// has set the clock.
  explicit Clock(std::shared_ptr<const VirtualTime> virtual_time);

  /// Reads the form "SCALE" or "SCALE@EPOCH". @throws std::invalid_argument naming the text.
  static Clock Parse(const std::string& text);
  std::string ToString() const;

  double scale() const { return scale_; }
  bool is_virtual() const { return virtual_time_ != nullptr; }

  /// Scaled CLOCK_REALTIME: what messages carry as `utime`.
  int64_t Utime() const;
  /// Scaled CLOCK_MONOTONIC: for deadlines and staleness. Its origin is arbitrary.
  int64_t Now() const;
  /// The date of signatures [us]: real time, not scaled, so that it rises from run to run; virtual
  /// time in a run in virtual time.
  int64_t SigningUtime() const;
  /// Scaled utime of a kernel time stamp (CLOCK_REALTIME nanoseconds); in virtual time of one of
  /// the run's.
  int64_t UtimeFromRealtimeNs(int64_t ns) const;
  /// Real time that corresponds to a scaled duration, for ppoll; negative durations give zero.
  timespec RealDuration(int64_t scaled_us) const;

 private:
  int64_t VirtualDate() const { return virtual_time_->now + virtual_time_->error; }

  double scale_;
  int64_t epoch_;
  std::shared_ptr<const VirtualTime> virtual_time_;  // null: it is not virtual
};

/// Deadlines of a periodic loop, absolute, so that lateness does not accumulate. Not thread-safe.
class Periodic {
 public:
  /// @param period scaled microseconds, > 0. @param now scaled monotonic time of the first
  /// deadline's start.
  Periodic(int64_t period, int64_t now) : period_(period), deadline_(now + period) {}

  /// Scaled microseconds until the deadline, 0 if it has passed.
  int64_t Remaining(int64_t now) const { return deadline_ > now ? deadline_ - now : 0; }
  bool Due(int64_t now) const { return now >= deadline_; }

  /// Moves on to the next deadline after `now`, and skips those that were missed altogether.
  /// @return how late this one was [us].
  int64_t Advance(int64_t now);

 private:
  int64_t period_;
  int64_t deadline_;
};

}  // namespace plumb
