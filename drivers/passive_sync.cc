#include "drivers/passive_sync.h"

#include <algorithm>
#include <cmath>

namespace plumb {

PassiveSync::PassiveSync(int64_t period, double rate_error, int64_t max_gap)
    : period_(static_cast<double>(period)), rate_error_(rate_error), max_gap_(max_gap) {}

void PassiveSync::Regularise(std::span<const int64_t> arrivals, std::span<int64_t> times) noexcept {
  // A sample is late by anything from nothing to three quarters of a period: beyond, one before it was lost.
  // The remaining quarter allows for an estimate that is itself late.
  const double tolerance = period_ / 4;
  const double step = period_ * (1 + rate_error_);
  for (size_t i = 0; i < arrivals.size(); ++i) {
    const auto since_origin = [this](int64_t arrival) { return static_cast<double>(arrival - origin_); };
    const double gap = started_ ? since_origin(arrivals[i]) - estimate_ : 0;
    if (!started_ || std::abs(gap) > static_cast<double>(max_gap_)) {
      const bool back = started_ && gap < 0;
      if (started_) ++resets_;
      started_ = true;
      origin_ = arrivals[i];
      estimate_ = 0;
      last_ = times[i] = back || resets_ == 0 ? origin_ : std::max(origin_, last_ + 1);
      continue;
    }
    // How late this sample and those behind it can be at most, if no sample were lost.
    double lateness = since_origin(arrivals[i]) - (estimate_ + step);
    for (size_t j = i + 1; j < arrivals.size(); ++j) {
      lateness = std::min(lateness, since_origin(arrivals[j]) - (estimate_ + static_cast<double>(j - i + 1) * step));
    }
    const double missed = std::max(0.0, std::floor((lateness + tolerance) / period_));
    lost_ += static_cast<int64_t>(missed);
    estimate_ = std::min(estimate_ + (1 + missed) * step, since_origin(arrivals[i]));
    last_ = times[i] = std::max(origin_ + static_cast<int64_t>(std::llround(estimate_)), last_ + 1);
  }
}

}  // namespace plumb
