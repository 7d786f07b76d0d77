#include "sim/simulators.h"

#include <fmt/format.h>

#include <stdexcept>

#include "robot/posterior_reader.h"
#include "sim/residual_inputs.h"

namespace plumb {

ParameterDistribution ReadSimulators(const std::filesystem::path& file,
                                     const RobotDescription& robot) {
  ParameterDistribution distribution = ReadPosterior(file, robot);
  try {
    if (distribution.residual) RequireResidualOf(robot, *distribution.residual);
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error(fmt::format("{}: residual: {}", file.string(), error.what()));
  }
  return distribution;
}

}  // namespace plumb
