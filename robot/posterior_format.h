#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <string>

#include "robot/description.h"

// The format of posterior.json, for its writer and its reader. Thread-safe.
namespace plumb {

inline constexpr char kPosteriorFormat[] = "plumbline posterior";
inline constexpr int kPosteriorVersion = 2;
/// The version that had no residual: what is not in it is none.
inline constexpr int kPosteriorBeforeResiduals = 1;

/// As a string: a JSON number is a double to most readers, which has 53 bits.
inline std::string Hexadecimal(uint64_t number) { return fmt::format("{:#018x}", number); }

/// As in robot.toml.
inline const char* CoordinateName(ParameterDescription::Coordinate coordinate) {
  switch (coordinate) {
    case ParameterDescription::Coordinate::kLog:
      return "log";
    case ParameterDescription::Coordinate::kLogit:
      return "logit";
    default:
      return "linear";
  }
}

}  // namespace plumb
