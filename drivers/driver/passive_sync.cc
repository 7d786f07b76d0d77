#include "drivers/driver/passive_sync.h"

#include <algorithm>
#include <cmath>

namespace plumb {
namespace {

constexpr double kEvidence = 3.5;  // periods of unpunctual samples that prove a loss: five samples

}  // namespace

PassiveSync::PassiveSync(int64_t period, double rate_error, int64_t max_gap)
    : period_(static_cast<double>(period)),
      step_(period_ * (1 + rate_error)),
      max_gap_(static_cast<double>(max_gap)) {}

size_t PassiveSync::Regularise(std::span<const int64_t> arrivals,
                               std::span<int64_t> times) noexcept {
  for (size_t i = 0; i < arrivals.size(); ++i) {
    const std::span<const int64_t> waiting = arrivals.subspan(i);
    const bool undecided =
        waiting.size() < kMaxWaiting &&
        static_cast<double>(waiting.back() - waiting.front()) < kEvidence * period_;
    const double gap = SinceOrigin(waiting.front()) - estimate_;
    // The estimate is never later than the arrival, and arrivals are in order: the clock was set
    // back.
    const bool jump = started_ && (gap > max_gap_ || gap < -period_);
    if (!started_ || jump) {
      if (jump && undecided) return i;
      if (jump) ++resets_;
      started_ = true;
      origin_ = waiting.front();
      estimate_ = Lateness(waiting, 0);
      const int64_t time = origin_ + std::llround(estimate_);
      last_ = times[i] = jump && gap > 0 ? std::max(time, last_ + 1) : time;
      continue;
    }
    // Nearly a period late is a period late: the estimate may itself be late.
    const double periods_late = std::floor(Lateness(waiting, estimate_ + step_) / period_ + 0.125);
    if (periods_late > 0 && undecided) return i;
    const double missed = std::max(0.0, periods_late);
    lost_ += static_cast<int64_t>(missed);
    estimate_ = std::min(estimate_ + (1 + missed) * step_, SinceOrigin(waiting.front()));
    const int64_t time = origin_ + std::llround(estimate_);
    last_ = times[i] = std::max(time, last_ + 1);
  }
  return arrivals.size();
}

double PassiveSync::Lateness(std::span<const int64_t> waiting, double first) const noexcept {
  double lateness = SinceOrigin(waiting.front()) - first;
  for (size_t i = 1; i < waiting.size(); ++i) {
    lateness =
        std::min(lateness, SinceOrigin(waiting[i]) - (first + static_cast<double>(i) * step_));
  }
  return lateness;
}

}  // namespace plumb
