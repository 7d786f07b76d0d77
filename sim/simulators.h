#pragma once

#include <filesystem>

#include "robot/description.h"
#include "robot/parameter_distribution.h"

namespace plumb {

/// ReadPosterior, to simulate with: a residual in it must fit the robot's simulators, too.
/// @throws std::runtime_error "file: field: what is wrong". Thread-safe.
ParameterDistribution ReadSimulators(const std::filesystem::path& file,
                                     const RobotDescription& robot);

}  // namespace plumb
