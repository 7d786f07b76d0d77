#pragma once

#include <cstdint>
#include <string>

#include "robot/parameter_distribution.h"

namespace plumb {

inline constexpr int kPosteriorDraws = 200;

/// A distribution of parameters beside its prior, for people to look at: moments, quantiles, and
/// kPosteriorDraws draws of each, in physical units; the same distribution, the same draws. A
/// parameter is "determined" if its standard deviation, in coordinates, is below 0.71 of the
/// prior's, as Identifiability has it. Thread-safe.
/// @return {"utime":..,"iteration":..,"parameters":[..],...}
std::string PosteriorJson(const ParameterDistribution& distribution,
                          const ParameterDistribution& prior, int64_t utime);

}  // namespace plumb
