#pragma once

namespace plumb {

/// x times x, in the square of its unit: standard deviations to variances. Thread-safe.
inline constexpr double Square(double x) { return x * x; }

}  // namespace plumb
