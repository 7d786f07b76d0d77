#pragma once

#include <span>

#include "calibrator/fit/methods.h"
#include "calibrator/motion/log.h"
#include "calibrator/results/findings.h"
#include "robot/description.h"

namespace plumb {

/// Learns from logs which simulators could have produced the robot's motion, and checks what it has
/// learned:
///   laplace        mode and curvature of the likelihood of windows of 1, 5, 10, 50 steps
///                  (FitCurriculum)
///   mixture        all modes, weighed by importance sampling of the one-step likelihood
///                  (FitByImportance)
///   reps           step-based SimOpt (Cui & Hensel): a Gaussian led by the log-likelihood at
///                  temperature 1 or more
///   simopt         the original (Chebotar et al.): whole trajectories
///   abc-rejection, abc-smc   simulations near enough to the data
///   auto           laplace; checked along its axes, and mixture instead where it is not what the
///                  likelihood looks like
///
/// The same bits for any number of threads.
/// @throws std::invalid_argument for an unknown method (naming the nearest) or data that cannot be
/// used.
Findings Calibrate(const RobotDescription& robot, std::span<const Log> logs,
                   const CalibrationOptions& options);

}  // namespace plumb
