#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>

#include "calibrator/motion/transitions.h"
#include "robot/residual.h"
#include "sim/model.h"

namespace plumb {

/// Root mean square errors of predicting so many recorded steps ahead with a residual's first draw,
/// without its noise and what is unknown: as Discrepancy::PredictionError, in standard units
/// (Task::state_scale), and infinite where a simulation has blown up. NaN where there is no such
/// window. Thread-safe.
/// @param physical parameters. @param residual of these. @param horizons >= 1.
/// @throws std::invalid_argument if the residual is another robot's, or there is no such simulator.
Eigen::VectorXd CorrectedPredictionErrors(const std::shared_ptr<const Model>& model,
                                          const Eigen::VectorXd& physical, const Residual& residual,
                                          std::span<const Rollout> rollouts,
                                          std::span<const int> horizons);

}  // namespace plumb
