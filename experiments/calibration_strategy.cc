#include "experiments/calibration_strategy.h"

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

std::string Key(CalibrationStrategy strategy) {
  return kNames.at(static_cast<size_t>(strategy)).key;
}
std::string Label(CalibrationStrategy strategy) {
  return kNames.at(static_cast<size_t>(strategy)).label;
}

bool Learns(CalibrationStrategy strategy) {
  return strategy == CalibrationStrategy::kOriginal || strategy == CalibrationStrategy::kStep ||
         strategy == CalibrationStrategy::kDefault;
}

std::unique_ptr<SimOpt> MakeSimOpt(CalibrationStrategy strategy, const RobotDescription& robot,
                                   uint64_t seed, int threads) {
  switch (strategy) {
    case CalibrationStrategy::kOriginal:
      return std::make_unique<SimOpt>(WithPaperSettings(robot), seed, threads,
                                      Objective::kTrajectory);
    case CalibrationStrategy::kStep:
      return std::make_unique<SimOpt>(WithPaperSettings(robot), seed, threads, Objective::kStep);
    case CalibrationStrategy::kDefault:
      return std::make_unique<SimOpt>(robot, seed, threads, "auto");
    default:
      throw std::invalid_argument(Key(strategy) + " does not learn");
  }
}

ParameterDistribution FirstDistribution(CalibrationStrategy strategy, const RobotDescription& robot,
                                        const Eigen::VectorXd& truth) {
  if (strategy == CalibrationStrategy::kNominal) return ParameterDistribution::Nominal(robot);
  ParameterDistribution distribution = ParameterDistribution::Prior(robot);
  Gaussian& component = distribution.mixture.components.at(0);
  if (strategy == CalibrationStrategy::kOracle) {
    for (Eigen::Index i = 0; i < truth.size(); ++i) {
      component.mean(i) = robot.parameters[static_cast<size_t>(i)].ToCoordinate(truth(i));
    }
    component.covariance.setZero();
  }
  return distribution;
}

}  // namespace plumb
