#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "calibrator/diagnostics/misspecification.h"
#include "calibrator/fit/window_errors.h"
#include "calibrator/motion/transitions.h"
#include "robot/description.h"
#include "tests/calibrator/changed_robot.h"

namespace plumb {

RobotDescription Robot(const std::string& name);

/// The robot that a log is recorded from, and its noise.
struct Truth {
  Changes changed = {};  ///< of parameters that are not fitted
  /// noise of the state a transition begins with, which is then the reading at the end of the one
  /// before
  double start_sd = 0;
  double end_sd = std::sqrt(1e-5);
};

/// Episodes of random actions, begun as the task does, until there are so many transitions.
std::vector<Rollout> RandomLog(const RobotDescription& fitted, const Truth& truth, int transitions,
                               uint64_t seed);

/// A log with the robot's own parameters fitted to it by Gauss-Newton, and everything that
/// FindMisspecification needs.
struct FittedLog {
  std::vector<Rollout> rollouts;
  std::vector<WindowErrors::Row> rows;
  RobotDescription known;  ///< as fitted
  Eigen::VectorXd physical;
  FitResiduals residuals;

  FittedLog(const RobotDescription& robot, std::vector<Rollout> log);

  Misspecification Find();
};

}  // namespace plumb
