#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "common/special_numbers.h"

namespace plumb {

/// Standard deviation of a normal distribution over its median of |x - mean|, 1 / Phi^-1(3/4):
/// times the median it is an estimate that outliers hardly move.
inline constexpr double kSdOverMedianDeviation = 1.4826;

/// The middle one of the values, which come in any order; of an even number the mean of the middle
/// two. @param values none of them NaN. @return NaN if there are none. Thread-safe.
inline double Median(std::vector<double> values) {
  if (values.empty()) return kNaN;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return (*std::max_element(values.begin(), middle) + *middle) / 2;
}

}  // namespace plumb
