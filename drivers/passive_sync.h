#pragma once

#include <cstdint>
#include <span>

namespace plumb {

/// Times of measurement of a periodic sensor, from times of arrival that are always late, by a varying amount
/// (E. Olson, "A passive solution to the sensor synchronization problem", IROS 2010).
///
/// Nothing arrives before it was measured, so of all arrivals the one with the least delay says most about the
/// sensor's clock. The estimate follows the period from there on; an arrival before the estimate pulls it down
/// at once, and otherwise it drifts up by the largest plausible error of the sensor's rate, so that a sensor
/// whose clock is slow is followed, too. The constant part of the delay cannot be known and remains.
///
/// A sample that comes more than about a period late is taken for the sample after a lost one, unless later
/// samples of the same batch show that it was only late. Does not allocate. Not thread-safe.
class PassiveSync {
 public:
  /// @param period [us] between samples, > 0.
  /// @param rate_error bound of the sensor clock's relative error.
  /// @param max_gap [us] of silence, or of a jump of the clock, after which it starts anew.
  explicit PassiveSync(int64_t period, double rate_error = 1e-4, int64_t max_gap = 1'000'000);

  /// @param arrivals [us] of the samples received since the last call, in order.
  /// @param times [us] of their measurement: as many, strictly increasing from call to call, except after a
  /// jump back of the clock by more than max_gap.
  void Regularise(std::span<const int64_t> arrivals, std::span<int64_t> times) noexcept;

  /// How often it started anew after the first sample.
  int64_t resets() const { return resets_; }
  /// Samples taken for lost.
  int64_t lost() const { return lost_; }

 private:
  double period_, rate_error_;
  int64_t max_gap_;
  bool started_ = false;
  int64_t origin_ = 0;   ///< arrival at the last start; keeps the doubles small
  double estimate_ = 0;  ///< [us] since origin, of the last sample
  int64_t last_ = 0;     ///< last output
  int64_t resets_ = 0, lost_ = 0;
};

}  // namespace plumb
