#include "common/clock.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>
#include <utility>

namespace plumb {
namespace {

int64_t RealNs(clockid_t id) {
  timespec t;
  clock_gettime(id, &t);
  return int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec;
}

}  // namespace

Clock::Clock(double scale, int64_t epoch) : scale_(scale), epoch_(epoch) {
  if (!(scale > 0 && scale <= 1000)) {
    throw std::invalid_argument(fmt::format("clock scale {} is not in (0, 1000]", scale));
  }
}

Clock::Clock(std::shared_ptr<const VirtualTime> virtual_time)
    : scale_(1), epoch_(0), virtual_time_(std::move(virtual_time)) {}

Clock Clock::Parse(const std::string& text) {
  const auto at = text.find('@');
  try {
    size_t used = 0;
    const std::string scale_text = text.substr(0, at);
    const double scale = std::stod(scale_text, &used);
    if (used != scale_text.size()) throw std::invalid_argument("trailing text");
    int64_t epoch = 0;
    if (at != std::string::npos) {
      const std::string epoch_text = text.substr(at + 1);
      epoch = std::stoll(epoch_text, &used);
      if (used != epoch_text.size()) throw std::invalid_argument("trailing text");
    }
    return Clock(scale, epoch);
  } catch (const std::exception&) {
    throw std::invalid_argument(
        fmt::format("clock '{}' is not SCALE or SCALE@EPOCH, scale in (0, 1000]", text));
  }
}

std::string Clock::ToString() const { return fmt::format("{}@{}", scale_, epoch_); }

int64_t Clock::UtimeFromRealtimeNs(int64_t ns) const {
  if (virtual_time_) return ns / 1000 + virtual_time_->error;
  if (scale_ == 1) return ns / 1000;
  const int64_t since_ns = ns - epoch_ * 1000;
  return epoch_ + std::llround(static_cast<double>(since_ns) * 1e-3 * scale_);
}

int64_t Clock::Utime() const {
  return virtual_time_ ? VirtualDate() : UtimeFromRealtimeNs(RealNs(CLOCK_REALTIME));
}

int64_t Clock::SigningUtime() const {
  return virtual_time_ ? VirtualDate() : RealNs(CLOCK_REALTIME) / 1000;
}

int64_t Clock::Now() const {
  if (virtual_time_) return virtual_time_->now;
  return std::llround(static_cast<double>(RealNs(CLOCK_MONOTONIC)) * 1e-3 * scale_);
}

timespec Clock::RealDuration(int64_t scaled_us) const {
  if (scaled_us <= 0) return {0, 0};
  const int64_t ns = std::llround(static_cast<double>(scaled_us) * 1e3 / scale_);
  return {static_cast<time_t>(ns / 1'000'000'000), static_cast<long>(ns % 1'000'000'000)};
}

int64_t Periodic::Advance(int64_t now) {
  const int64_t lateness = now - deadline_;
  deadline_ += period_;
  if (deadline_ <= now) deadline_ += ((now - deadline_) / period_ + 1) * period_;
  return lateness;
}

}  // namespace plumb
