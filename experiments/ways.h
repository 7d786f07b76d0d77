#pragma once

#include <functional>
#include <memory>
#include <string>

#include "calibrator/live/simopt.h"
#include "robot/parameter_distribution.h"

namespace plumb {

/// Ways of choosing the simulators that a policy is trained on.
enum class Way {
  kNominal,  ///< no randomisation: the prior's means
  kPrior,    ///< domain randomisation: the prior, whatever the robot does
  /// SimOpt (Chebotar et al., ICRA 2019), settings of Cui & Hensel: 25 samples, one update an
  /// iteration, KL 0.1
  kOriginal,
  kStep,     ///< step-based SimOpt (Cui & Hensel), the same settings
  kDefault,  ///< what Plumbline does if nobody says otherwise
  kOracle,   ///< the truth, which no robot tells
};

std::string Key(Way way);    ///< a word, for tables
std::string Label(Way way);  ///< for people

/// Whether it learns from what the robot does.
bool Learns(Way way);

/// SimOpt by a way that learns. @param robot with its calibration settings; those of the paper
/// replace them where the way is of the paper.
std::unique_ptr<SimOpt> MakeSimOpt(Way way, const RobotDescription& robot, uint64_t seed,
                                   int threads);

/// Where a way begins. @param truth physical units; for kOracle.
ParameterDistribution FirstDistribution(Way way, const RobotDescription& robot,
                                        const Eigen::VectorXd& truth);

/// SimOpt's present distribution.
ParameterDistribution DistributionOf(const SimOpt& simopt, const RobotDescription& robot);

}  // namespace plumb
