#pragma once

#include <cstddef>

namespace plumb {

/// Of one episode, or of what has not been joined yet: 400 s of a driver at 500 Hz. A calibrator
/// that hears keeps no more, whoever sends it.
inline constexpr size_t kMostEpisodeStates = 200'000;

}  // namespace plumb
