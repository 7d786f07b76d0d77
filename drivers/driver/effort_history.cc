#include "drivers/driver/effort_history.h"

#include <algorithm>

#include "common/special_numbers.h"

namespace plumb {

EffortHistory::EffortHistory(int num_joints, int capacity)
    : joints_(static_cast<size_t>(num_joints)),
      capacity_(static_cast<size_t>(capacity)),
      utime_(capacity_),
      effort_(capacity_ * joints_) {}

void EffortHistory::Record(int64_t utime, std::span<const double> effort) noexcept {
  if (count_ > 0 && utime <= utime_[newest_]) count_ = 0;
  newest_ = (newest_ + 1) % capacity_;
  utime_[newest_] = utime;
  std::copy_n(effort.begin(), joints_,
              effort_.begin() + static_cast<std::ptrdiff_t>(newest_ * joints_));
  count_ = std::min(count_ + 1, capacity_);
}

void EffortHistory::Average(int64_t from, int64_t to, std::span<double> average) const noexcept {
  const bool covered = count_ > 0 && from < to && utime_[Slot(count_ - 1)] <= from;
  std::fill_n(average.begin(), joints_, covered ? 0 : kNaN);
  if (!covered) return;
  int64_t end = to;
  for (size_t age = 0; age < count_ && end > from; ++age) {
    const size_t slot = Slot(age);
    const int64_t begin = std::max(utime_[slot], from);
    if (begin >= end) continue;
    const double weight = static_cast<double>(end - begin) / static_cast<double>(to - from);
    for (size_t joint = 0; joint < joints_; ++joint)
      average[joint] += weight * effort_[slot * joints_ + joint];
    end = begin;
  }
}

void EffortHistory::At(int64_t utime, std::span<double> effort) const noexcept {
  std::fill_n(effort.begin(), joints_, kNaN);
  for (size_t age = 0; age < count_; ++age) {
    const size_t slot = Slot(age);
    if (utime_[slot] > utime) continue;
    std::copy_n(effort_.begin() + static_cast<std::ptrdiff_t>(slot * joints_), joints_,
                effort.begin());
    return;
  }
}

}  // namespace plumb
