#pragma once

#include <cstdint>
#include <string>

#include "robot/description.h"
#include "robot/parameter_distribution.h"

namespace plumb {

/// What a randomisation table is drawn with.
struct RandomisationOptions {
  int samples = 100;   ///< >= 1
  uint64_t seed = 1;   ///< of all random numbers
  std::string source;  ///< of the distribution, for people: a file, or "prior"
};

/// A table of simulators for whoever trains elsewhere, as JSON (docs/other-simulators.md has its
/// fields), in physical units: the distribution's mean and sd, the covariance, whose correlations
/// are those of 10 000 draws, and samples. What no robot can have, a mass below zero, is drawn
/// again. The same bytes for the same distribution and options.
/// @throws std::invalid_argument if there is no sample or no parameter, if the distribution is
/// another robot's, or if less than one draw in a hundred is a robot. Thread-safe.
std::string RandomisationJson(const ParameterDistribution& distribution,
                              const RobotDescription& robot, const RandomisationOptions& options);

}  // namespace plumb
