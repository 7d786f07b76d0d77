#pragma once

#include <limits>

namespace plumb {

/// What std::numeric_limits<double> has, under the names that formulas use: +infinity, and a quiet
/// NaN for what is not known. IEEE 754; in no unit.
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();
inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

}  // namespace plumb
