#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "common/special_numbers.h"

namespace plumb {

/// Quantile of sorted values, linear between them (type 7 of Hyndman and Fan, The American
/// Statistician 50, 1996). Thread-safe.
/// @param sorted none of them NaN. @param share 0 to 1. @return NaN of no values.
inline double Quantile(const std::vector<double>& sorted, double share) {
  if (sorted.empty()) return kNaN;
  const double at = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<size_t>(at);
  const size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (at - static_cast<double>(below)) * (sorted[above] - sorted[below]);
}

}  // namespace plumb
