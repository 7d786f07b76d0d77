#include "drivers/bus/response_time.h"

#include <algorithm>
#include <cstddef>

namespace plumb {
namespace {

constexpr int kMaxRounds = 100'000;  // of an iteration that is known to end

int64_t Releases(const FrameTimes& frame, int64_t window) {
  return (window + frame.jitter + frame.period - 1) / frame.period;
}

}  // namespace

int64_t ResponseTime(const std::vector<FrameTimes>& frames, int64_t blocking, int64_t bit) {
  const FrameTimes& own = frames.back();
  double load = 0;
  for (const FrameTimes& frame : frames)
    load += static_cast<double>(frame.cost) / static_cast<double>(frame.period);
  if (load >= 1) return -1;
  // The longest time in which the bus is busy with this one and higher ones.
  int64_t busy = own.cost;
  for (int round = 0;; ++round) {
    if (round > kMaxRounds) return -1;
    int64_t next = blocking;
    for (const FrameTimes& frame : frames) next += Releases(frame, busy) * frame.cost;
    if (next == busy) break;
    busy = next;
  }
  int64_t worst = 0;
  for (int64_t instance = 0; instance < Releases(own, busy); ++instance) {
    int64_t wait = blocking + instance * own.cost;
    for (int round = 0;; ++round) {
      if (round > kMaxRounds) return -1;
      int64_t next = blocking + instance * own.cost;
      for (size_t i = 0; i + 1 < frames.size(); ++i)
        next += Releases(frames[i], wait + bit) * frames[i].cost;
      if (next == wait) break;
      wait = next;
    }
    worst = std::max(worst, own.jitter + wait - instance * own.period + own.cost);
  }
  return worst;
}

}  // namespace plumb
