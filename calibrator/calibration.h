#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "calibrator/findings.h"
#include "calibrator/log.h"
#include "robot/description.h"

namespace plumb {

/// How to calibrate.
struct CalibrationOptions {
  std::string method = "auto";             ///< one of CalibrationMethods()
  std::string discrepancy = "likelihood";  ///< of abc-rejection and abc-smc, see RobotProblem
  /// laplace: control steps of the windows, stage by stage
  std::vector<int> horizons{1, 5, 10, 50};
  /// transitions that reps, simopt, the abc's and mixture may simulate
  int64_t budget = 100'000;
  uint64_t seed = 1;
  Workforce workforce;
  std::function<void(const std::string& what, double share)> progress = [](const std::string&,
                                                                           double) {};
};

/// auto, laplace, mixture, reps, simopt, abc-rejection, abc-smc.
const std::vector<std::string>& CalibrationMethods();

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
