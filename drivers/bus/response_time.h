#pragma once

#include <cstdint>
#include <vector>

namespace plumb {

/// Of the frames of one message [ns]. Plain data.
struct FrameTimes {
  int64_t cost;    ///< on the bus, with the most stuff bits, > 0
  int64_t period;  ///< from one being due to the next, > 0
  int64_t jitter;  ///< by which one may be queued late
};

/// From being due to having been sent, at worst: the exact analysis of Davis et al., see BusPlan.
/// @param frames the last message's, behind those of all that go before it in priority.
/// @param blocking [ns] of what may have begun. @param bit [ns] that one takes.
/// @return [ns] or -1: it may wait for ever. Thread-safe.
int64_t ResponseTime(const std::vector<FrameTimes>& frames, int64_t blocking, int64_t bit);

}  // namespace plumb
