#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "calibrator/motion/transitions.h"
#include "common/batch_runner.h"
#include "common/gaussian.h"
#include "sim/model.h"

namespace plumb {

/// What a simulator that takes its substeps half as long would make of a fit.
struct FinerSteps {
  /// by which the fitted parameters would change, in the prior's standard deviations
  Eigen::VectorXd displacement;
  /// sums of squares of errors that count, in units of their scale: as they are, and with finer
  /// steps and parameters displaced
  double before = 0, after = 0;

  /// The log tells, or cannot tell otherwise, that finer steps are nearer to the robot. A log of
  /// this very simulator says that they are not.
  bool credible() const { return after <= before + kClearly; }
  /// Share of the errors' squares that finer steps explain.
  double explained() const { return 1 - after / before; }

  static constexpr double kClearly = 9;  ///< three standard deviations, squared
};

/// A robot does not move in steps, and a simulator whose substeps are too long differs from it as
/// one with wrong parameters does. Simulates the windows of a fit with half the substep, in one
/// Gauss-Newton step. Errors beyond kOutlier times the scale do not count.
/// @param horizon of the windows. @param noise_sd of each entry of (q, v) where the record does not
/// say. @param mean of the fit, coordinates. @return nothing if a simulator fails. Threads as
/// `execution` says. Thread-safe.
std::optional<FinerSteps> TryFinerSteps(const std::shared_ptr<const Model>& model,
                                        std::span<const Rollout> rollouts, int horizon,
                                        const Eigen::VectorXd& noise_sd,
                                        const Eigen::VectorXd& mean, ExecutionOptions execution,
                                        int64_t* simulated_steps);

/// Why the substep is too long, for people: the posterior's mean would move by more than its
/// standard deviation, or a fifth of the errors' squares would be gone. Empty if it is not.
/// @param posterior moments, coordinates.
std::string WhyTooLong(const FinerSteps& finer, const RobotDescription& robot,
                       const Gaussian& posterior);

}  // namespace plumb
