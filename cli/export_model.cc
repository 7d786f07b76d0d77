#include "cli/export_model.h"

#include <spdlog/spdlog.h>

#include <iostream>
#include <stdexcept>

#include "calibrator/results/identified_mjcf.h"
#include "calibrator/results/identified_urdf.h"
#include "calibrator/results/randomisation.h"
#include "cli/outputs.h"
#include "common/atomic_file.h"
#include "sim/simulators.h"

namespace plumb {

int ExportModel(const ExportModelFlags& flags) {
  const std::vector<std::string> outputs{flags.urdf, flags.mjcf, flags.randomisation};
  if (flags.urdf.empty() && flags.mjcf.empty() && flags.randomisation.empty())
    throw std::invalid_argument("there is nothing to write: give --urdf, --mjcf, --randomisation");
  const RobotDescription robot = LoadRobot(flags.robot);
  for (const std::string& warning : robot.warnings) spdlog::warn(warning);
  const bool prior = flags.posterior.empty();
  const ParameterDistribution distribution =
      prior ? ParameterDistribution::Prior(robot) : ReadSimulators(flags.posterior, robot);
  std::vector<std::string> inputs = FilesOf(robot);
  inputs.push_back(flags.posterior);
  RequireOutputs(outputs, inputs);
  const Eigen::VectorXd mean = distribution.Mean(), sd = distribution.Sd();
  const bool residual = distribution.residual != nullptr;
  if (!flags.urdf.empty()) WriteIdentifiedUrdf(flags.urdf, robot, mean, sd, residual);
  if (!flags.mjcf.empty()) WriteAtomically(flags.mjcf, IdentifiedMjcf(robot, mean, sd, residual));
  if (!flags.randomisation.empty()) {
    WriteAtomically(flags.randomisation, RandomisationJson(distribution, robot,
                                                           {flags.samples, flags.seed,
                                                            prior ? "prior" : flags.posterior}));
  }
  std::string wrote;
  for (const std::string& file : outputs) {
    if (!file.empty()) wrote += (wrote.empty() ? "wrote " : ", ") + file;
  }
  std::cout << wrote << std::endl;
  return 0;
}

}  // namespace plumb
