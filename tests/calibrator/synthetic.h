#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "calibrator/motion/transitions.h"
#include "common/gaussian.h"
#include "robot/description.h"

namespace plumb {

RobotDescription Pendulum();

/// A roll-out of the pendulum with known parameters under random efforts of 50 ms in ten segments,
/// with independent noise of known size on every recorded state.
Rollout SyntheticRollout(const RobotDescription& robot, const Eigen::VectorXd& truth, int steps,
                         double q_sd, double v_sd, uint32_t stream);

/// The Laplace approximation of the posterior, by Gauss-Newton from `start` (coordinates):
/// independent of REPS.
Gaussian LaplacePosterior(const RobotDescription& robot, const std::vector<Rollout>& rollouts,
                          Eigen::VectorXd start);

}  // namespace plumb
