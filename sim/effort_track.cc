#include "sim/effort_track.h"

#include <algorithm>

namespace plumb {
namespace {

// Segments that are kept at most of the past: a 1 kHz command for as long as any delay.
constexpr size_t kMaxSegments = 1024;

}  // namespace

EffortTrack::EffortTrack(int velocities, double remembered)
    : n_(static_cast<size_t>(velocities)), remembered_(remembered) {
  ends_.reserve(kMaxSegments + 1);
  efforts_.reserve((kMaxSegments + 1) * n_);
  Clear();
}

void EffortTrack::Clear() {
  ends_.assign(1, 0.0);
  efforts_.assign(n_, 0.0);
}

void EffortTrack::Append(const double* effort, double duration) {
  if (!(duration > 0)) return;
  const double end = ends_.back() + duration;
  if (std::equal(effort, effort + n_, efforts_.end() - static_cast<std::ptrdiff_t>(n_))) {
    ends_.back() = end;
    return;
  }
  ends_.push_back(end);
  efforts_.insert(efforts_.end(), effort, effort + n_);
}

void EffortTrack::Advance() {
  const double now = ends_.back();
  for (double& end : ends_) end -= now;
  size_t old = 0;
  while (old + 1 < ends_.size() && (ends_[old] < -remembered_ || ends_.size() - old > kMaxSegments))
    ++old;
  ends_.erase(ends_.begin(), ends_.begin() + static_cast<std::ptrdiff_t>(old));
  efforts_.erase(efforts_.begin(), efforts_.begin() + static_cast<std::ptrdiff_t>(old * n_));
}

EffortTrack::Moments EffortTrack::Over(size_t i, double begin, double end, double delay) {
  const double from = begin - delay, to = end - delay;
  const bool earlier = latest_ >= ends_.size() || (latest_ > 0 && ends_[latest_ - 1] > from);
  size_t k = earlier ? 0 : latest_;
  while (k + 1 < ends_.size() && ends_[k] <= from) ++k;
  latest_ = k;
  if (k + 1 == ends_.size() || ends_[k] >= to) return {efforts_[k * n_ + i], 0};
  const double middle = (from + to) / 2;
  double impulse = 0, first = 0;
  for (double at = from; at < to; ++k) {
    const double until = k + 1 == ends_.size() ? to : std::min(ends_[k], to);
    const double effort = efforts_[k * n_ + i];
    impulse += effort * (until - at);
    first += effort * (until - at) * (middle - (at + until) / 2);
    at = until;
  }
  return {impulse / (to - from), first};
}

}  // namespace plumb
