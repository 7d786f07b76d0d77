#pragma once

#include <fmt/format.h>

#include <Eigen/Core>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>
#include <vector>

#include "common/special_numbers.h"

namespace plumb {

// Values of a checkpoint, as JSON has them. All throw nlohmann::json::exception where the type is
// another. Thread-safe.

inline nlohmann::json ToJson(const Eigen::VectorXd& x) {
  return std::vector<double>(x.begin(), x.end());
}

inline Eigen::VectorXd VectorFrom(const nlohmann::json& j) {
  const auto values = j.get<std::vector<double>>();
  return Eigen::VectorXd::Map(values.data(), static_cast<Eigen::Index>(values.size()));
}

/// A number with a fraction, or a greater one, would become one that nobody wrote.
/// @throws std::runtime_error saying so.
template <class Int = int>
Int Whole(const nlohmann::json& j) {
  const bool fits = j.is_number_unsigned()
                        ? std::in_range<Int>(j.get<uint64_t>())
                        : j.is_number_integer() && std::in_range<Int>(j.get<int64_t>());
  if (!fits)
    throw std::runtime_error(fmt::format("{} is not a whole number, or too great", j.dump()));
  return j.get<Int>();
}

/// JSON has no NaN: null.
inline double NumberOrNaN(const nlohmann::json& j) { return j.is_null() ? kNaN : j.get<double>(); }

}  // namespace plumb
