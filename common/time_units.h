#pragma once

#include <chrono>
#include <cmath>
#include <cstdint>

namespace plumb {

// Messages and clocks count microseconds, equations have seconds. Thread-safe.

constexpr double Seconds(int64_t microseconds) { return static_cast<double>(microseconds) * 1e-6; }

/// Rounded to the nearest. @param seconds less than 2^63 microseconds, no NaN.
inline int64_t Microseconds(double seconds) { return std::llround(seconds * 1e6); }

/// Of real time.
inline double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace plumb
