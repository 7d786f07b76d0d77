#include "experiments/ways.h"

#include <array>
#include <stdexcept>

namespace plumb {
namespace {

struct Names {
  const char *key, *label;
};
constexpr std::array<Names, 6> kNames{{{"nominal", "no randomisation"},
                                       {"prior", "the prior, fixed"},
                                       {"original", "original SimOpt (whole trajectories)"},
                                       {"step", "step-based SimOpt (paper)"},
                                       {"default", "Plumbline's default"},
                                       {"oracle", "oracle: the true parameters"}}};

// Table of Cui & Hensel.
RobotDescription WithPaperSettings(RobotDescription robot) {
  robot.calibration.samples = 25;
  robot.calibration.updates = 1;
  robot.calibration.kl = 0.1;
  return robot;
}

}  // namespace

std::string Key(Way way) { return kNames.at(static_cast<size_t>(way)).key; }
std::string Label(Way way) { return kNames.at(static_cast<size_t>(way)).label; }

bool Learns(Way way) { return way == Way::kOriginal || way == Way::kStep || way == Way::kDefault; }

std::unique_ptr<SimOpt> MakeSimOpt(Way way, const RobotDescription& robot, uint64_t seed,
                                   int threads) {
  switch (way) {
    case Way::kOriginal:
      return std::make_unique<SimOpt>(WithPaperSettings(robot), seed, threads,
                                      Objective::kTrajectory);
    case Way::kStep:
      return std::make_unique<SimOpt>(WithPaperSettings(robot), seed, threads, Objective::kStep);
    case Way::kDefault:
      return std::make_unique<SimOpt>(robot, seed, threads, "auto");
    default:
      throw std::invalid_argument(Key(way) + " does not learn");
  }
}

ParameterDistribution FirstDistribution(Way way, const RobotDescription& robot,
                                        const Eigen::VectorXd& truth) {
  ParameterDistribution distribution = ParameterDistribution::Prior(robot);
  Gaussian& component = distribution.mixture.components.at(0);
  if (way == Way::kOracle) {
    for (Eigen::Index i = 0; i < truth.size(); ++i) {
      component.mean(i) = robot.parameters[static_cast<size_t>(i)].ToCoordinate(truth(i));
    }
  }
  if (way == Way::kOracle || way == Way::kNominal) component.covariance.setZero();
  return distribution;
}

ParameterDistribution DistributionOf(const SimOpt& simopt, const RobotDescription& robot) {
  return {simopt.state().iteration, robot.parameters, simopt.state().distribution};
}

}  // namespace plumb
