#pragma once

#include <span>

#include "calibrator/fit/method.h"
#include "calibrator/motion/log.h"
#include "calibrator/results/findings.h"
#include "robot/description.h"
#include "umbridge/remote_model.h"

namespace plumb {

/// Numbers that a model of the next states comes to: 2 v for each transition of the logs, as
/// RobotModels' next_states. Thread-safe.
Eigen::Index NextStatesSize(const RobotDescription& robot, std::span<const Log> logs);

/// Learns which parameters of somebody else's simulator could have produced the robot's motion:
/// Laplace's approximation of the likelihood of its one-step errors (FitLaplace), from the prior's
/// mean, whitened as our own simulator carries noise along (WindowErrors). What judges a model, and
/// hold-out and advice, would need more of it than next states, and says that it was not made.
/// @param model of n parameters, physical units, that comes to the next states.
/// @throws std::invalid_argument if the logs cannot be used, or the model fails at the prior's
/// mean; std::runtime_error see RemoteModel. Not thread-safe.
Findings CalibrateRemote(const RobotDescription& robot, std::span<const Log> logs,
                         RemoteModel& model, const CalibrationOptions& options);

}  // namespace plumb
