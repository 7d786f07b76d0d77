#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/driver/passive_sync.h"

namespace plumb {

/// A queue of the samples of one periodic sensor, with times of measurement (PassiveSync) instead
/// of times of arrival. Does not allocate. Not thread-safe.
template <class Sample>
class TimedSamples {
 public:
  /// @param period [us] at which the sensor measures.
  explicit TimedSamples(int64_t period) : sync_(period) {}

  /// @param arrival [us] utime of reception.
  void Add(const Sample& sample, int64_t arrival) noexcept {
    if (count_ == kCapacity) {
      // Should nobody take them, time must go on nevertheless.
      Regularise();
      Drop();
    }
    At(count_++) = {arrival, sample};
  }
  /// Finds the times of what was added; call it before looking at the front.
  void Regularise() noexcept {
    std::array<int64_t, kCapacity> arrivals, times;
    const size_t fresh = count_ - regular_;
    for (size_t i = 0; i < fresh; ++i) arrivals[i] = At(regular_ + i).time;
    const size_t timed =
        sync_.Regularise(std::span(arrivals).first(fresh), std::span(times).first(fresh));
    for (size_t i = 0; i < timed; ++i) At(regular_ + i).time = times[i];
    regular_ += timed;
    // The clock was set back in between: what was measured by the old time would stand in the way
    // of the new.
    while (regular_ > 1 && At(1).time < At(0).time) Drop();
  }

  /// True if there is one whose time is known.
  bool ready() const noexcept { return regular_ > 0; }
  int64_t time() const noexcept { return ring_[head_].time; }  ///< [us] of the oldest
  const Sample& front() const noexcept { return ring_[head_].sample; }
  void Pop() noexcept {
    head_ = (head_ + 1) % kCapacity;
    --count_;
    --regular_;
  }
  /// Takes out one that nobody could use.
  void Drop() noexcept {
    Pop();
    ++dropped_;
  }

  /// Those dropped and those that never came; a gap or a step of the clock, after which it began
  /// anew, counts as one.
  int64_t lost() const noexcept { return dropped_ + sync_.lost() + sync_.resets(); }

 private:
  static constexpr size_t kCapacity = 64;
  struct Entry {
    int64_t time = 0;  ///< of arrival until regularised, then of measurement
    Sample sample{};
  };
  Entry& At(size_t i) noexcept { return ring_[(head_ + i) % kCapacity]; }

  PassiveSync sync_;
  std::array<Entry, kCapacity> ring_;
  /// the first `regular` of `count` have times of measurement
  size_t head_ = 0, count_ = 0, regular_ = 0;
  int64_t dropped_ = 0;
};

}  // namespace plumb
