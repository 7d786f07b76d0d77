#include "estimator/sensor_watch.h"

#include <algorithm>

namespace plumb {

void AgreementWatch::Add(double level, double rate, double elapsed) {
  if (readings_ == 0 || elapsed > kLongestGap) {
    readings_ = 1;
    first_level_ = level_ = level;
    first_rate_ = rate_ = rate;
    time_ = integral_ = variance_ = largest_step_ = 0;
    level_moved_ = rate_moved_ = false;
    return;
  }
  ++readings_;
  const double moved = (rate + rate_) / 2 * elapsed;  // the trapezium's rule
  const double step = level - level_ - moved;
  if (std::abs(step) > std::abs(largest_step_)) largest_step_ = step;
  level_moved_ = level_moved_ || level != level_;
  rate_moved_ = rate_moved_ || rate != rate_;
  time_ += elapsed;
  integral_ += moved;
  variance_ += s_.rate_sd * s_.rate_sd * elapsed * elapsed;
  level_ = level;
  rate_ = rate;
  if (time_ >= kWindow) Judge();
}

void AgreementWatch::Judge() {
  const double excess = level_ - first_level_ - integral_;
  const double noise = kSigmas * std::sqrt(2 * s_.level_sd * s_.level_sd + variance_);
  // A rate that lags by tau has lost tau times what it changed by.
  const double allowed = noise + s_.rate_bias * time_ + s_.rate_lag * std::abs(rate_ - first_rate_);
  duration_ = time_;
  excess_ = excess;
  jump_ = largest_step_;
  if (std::abs(excess) <= allowed)
    finding_ = Finding::kNone;
  else if (!level_moved_)
    finding_ = Finding::kLevelStuck;
  else if (!rate_moved_)
    finding_ = Finding::kRateStuck;
  else if (std::abs(largest_step_) > 0.8 * std::abs(excess))
    finding_ = Finding::kLevelJumped;
  else
    finding_ = Finding::kDisagree;
  // The next window begins where this one ends.
  const double level = level_, rate = rate_;
  readings_ = 0;
  Add(level, rate, 0);
}

}  // namespace plumb
