#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace plumb {

/// The efforts that each joint was told to produce, and when: the drives hold a setpoint until the
/// next one, so the effort is a staircase with steps at the times of transmission. Record and
/// Average do not allocate. Not thread-safe.
class EffortHistory {
 public:
  /// @param capacity steps remembered, > 0.
  EffortHistory(int num_joints, int capacity);

  /// From `utime` [us] on the joints' setpoints are these. Time that does not advance (the clock
  /// was set back) forgets everything before.
  void Record(int64_t utime, std::span<const double> effort) noexcept;

  /// Time averages over [from, to]; NaN unless from < to and the history reaches back to `from`.
  void Average(int64_t from, int64_t to, std::span<double> average) const noexcept;
  /// Those at a time; NaN unless the history reaches back to it.
  void At(int64_t utime, std::span<double> effort) const noexcept;

 private:
  size_t Slot(size_t age) const { return (newest_ + capacity_ - age) % capacity_; }

  size_t joints_, capacity_;
  std::vector<int64_t> utime_;
  std::vector<double> effort_;  ///< capacity x joints, row by row
  size_t newest_ = 0, count_ = 0;
};

}  // namespace plumb
