#pragma once

#include <functional>
#include <memory>
#include <string>

#include "calibrator/live/simopt.h"
#include "robot/parameter_distribution.h"

namespace plumb {

/// How the simulators are chosen that a policy is trained on.
enum class CalibrationStrategy {
  kNominal,  ///< no randomisation: the prior's means
  kPrior,    ///< domain randomisation: the prior, whatever the robot does
  /// SimOpt (Chebotar et al., ICRA 2019), settings of Cui & Hensel: 25 samples, one update an
  /// iteration, KL 0.1
  kOriginal,
  kStep,     ///< step-based SimOpt (Cui & Hensel), the same settings
  kDefault,  ///< Plumbline's default method
  kOracle,   ///< the truth, which no robot tells
};

std::string Key(CalibrationStrategy strategy);    ///< a word, for tables
std::string Label(CalibrationStrategy strategy);  ///< for people

/// Whether it learns from what the robot does.
bool Learns(CalibrationStrategy strategy);

/// SimOpt by a strategy that learns. @param robot with its calibration settings; those of the paper
/// replace them where the strategy is of the paper.
std::unique_ptr<SimOpt> MakeSimOpt(CalibrationStrategy strategy, const RobotDescription& robot,
                                   uint64_t seed, int threads);

/// The distribution of simulators to begin with. @param truth physical units; for kOracle.
ParameterDistribution FirstDistribution(CalibrationStrategy strategy, const RobotDescription& robot,
                                        const Eigen::VectorXd& truth);

}  // namespace plumb
