#pragma once

#include <Eigen/Core>
#include <vector>

#include "calibrator/motion/transitions.h"
#include "robot/parameter_distribution.h"

namespace plumb {

/// How far simulators drawn from a distribution are, after n = 1 ... `horizon` control steps, from
/// what a robot did: reset to a recorded state, apply what was applied, compare. Root mean square
/// over simulators, windows and entries of (q, v), in standard units (Task::state_scale). A
/// simulation that fails errs by `kFailed`. Thread-safe.
/// @param rollouts with states without noise: that of the judge would count as an error.
/// @param every a window begins at every `every`-th state.
/// @return `horizon` numbers; NaN where no roll-out is as long.
Eigen::VectorXd NStepErrors(const RobotDescription& robot,
                            const ParameterDistribution& distribution,
                            const std::vector<Rollout>& rollouts, int horizon, int simulators,
                            int every, uint64_t seed);

constexpr double kFailed = 10;  ///< standard units

}  // namespace plumb
