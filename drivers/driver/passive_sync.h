#pragma once

#include <cstdint>
#include <span>

namespace plumb {

/// Times of measurement of a periodic sensor, from times of arrival that are always late, by a
/// varying amount (E. Olson, "A passive solution to the sensor synchronization problem", IROS
/// 2010).
///
/// Nothing arrives before it was measured, so of all arrivals the one with the least delay says
/// most about the sensor's clock. The estimate follows the period from there on; an arrival before
/// the estimate pulls it down at once, and otherwise it drifts up by the largest plausible error of
/// the sensor's rate, so that a sensor whose clock is slow is followed, too. The constant part of
/// the delay cannot be known and remains.
///
/// A sample that comes a period late may have been held up, or the one before it was lost. Those
/// behind it tell: samples that were held up arrive together, the last of them nearly punctual. It
/// therefore waits until one behind it is, or until those of four periods agree that there was a
/// loss. Does not allocate. Not thread-safe.
class PassiveSync {
 public:
  /// @param period [us] between samples, > 0.
  /// @param rate_error bound of the sensor clock's relative error.
  /// @param max_gap [us] of silence, or of a jump ahead of the clock, after which it starts anew.
  /// After a jump back by more than a period it always does.
  explicit PassiveSync(int64_t period, double rate_error = 1e-4, int64_t max_gap = 1'000'000);

  static constexpr size_t kMaxWaiting = 32;  ///< samples that may wait, whatever they are

  /// @param arrivals [us] of the samples that have no time yet, in order.
  /// @param times [us] of their measurement, room for as many: strictly increasing from call to
  /// call, except after a jump back of the clock by more than a period.
  /// @return how many times it gives: all, but for less than kMaxWaiting at the end, to be passed
  /// again.
  size_t Regularise(std::span<const int64_t> arrivals, std::span<int64_t> times) noexcept;

  /// How often it started anew after the first sample.
  int64_t resets() const { return resets_; }
  /// Samples taken for lost.
  int64_t lost() const { return lost_; }

 private:
  double SinceOrigin(int64_t arrival) const noexcept {
    return static_cast<double>(arrival - origin_);
  }
  /// The least lateness [us] of waiting samples, if none of them was lost and the first was
  /// measured at `first` since origin.
  double Lateness(std::span<const int64_t> waiting, double first) const noexcept;

  double period_, step_, max_gap_;
  bool started_ = false;
  int64_t origin_ = 0;   ///< arrival at the last start; keeps the doubles small
  double estimate_ = 0;  ///< [us] since origin, of the last sample
  int64_t last_ = 0;     ///< last output
  int64_t resets_ = 0, lost_ = 0;
};

}  // namespace plumb
