#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "calibrator/fit/window_errors.h"
#include "calibrator/inference/laplace.h"
#include "common/batch_runner.h"

namespace plumb {

// Thread-safe, but for errors that two threads would share; threads as ExecutionOptions says.

struct CurriculumOptions {
  std::vector<int> horizons{1, 5, 10, 50};  ///< control steps of each stage's windows, increasing
  /// first guesses: the prior's mean, and draws of the prior
  int starts = 4;
  uint64_t seed = 1;
  ExecutionOptions execution;
  /// Told what has just been done, and which share of the work, roughly; may throw to break off.
  std::function<void(const std::string& what, double share)> progress = [](const std::string&,
                                                                           double) {};
};

/// One stage of a fit: windows of so many steps.
struct CurriculumStage {
  int horizon;
  int64_t windows;
  int64_t simulated_steps;
  double discrepancy;        ///< mean squared whitened error at its end
  Eigen::VectorXd mean, sd;  ///< coordinates
};

struct CurriculumFit {
  LaplaceFit fit;  ///< of the longest windows that the model explains
  /// further modes that explain the shortest windows about as well
  std::vector<LaplaceFit> others;
  std::vector<CurriculumStage> stages;  ///< those that count
  int horizon = 1;                      ///< of the last of them
  Eigen::VectorXd noise_sd;             ///< of each entry of (q, v), physical units
  /// errors of one step at the final mode; its curvature is that of the first stage
  LaplaceFit one_step;
  std::vector<WindowErrors::Row> rows;  ///< of one_step's errors
  bool noise_known = false;
  int64_t simulated_steps = 0;
  int64_t failures = 0;
  std::vector<std::string> warnings;
};

/// Laplace's approximation from windows of one step (or ShortestWindow), where the mode is found
/// from anywhere, then of more and more steps, each stage from the mode of the one before: the
/// accuracy of long windows with the convergence of short ones. Several first guesses are tried on
/// a part of the transitions.
///
/// A stage whose errors are larger than the noise of the first one by 15 %, or whose mode lies 3.5
/// standard deviations from the one before, says that the model is not the robot over so many
/// steps, or that they are too many for the linearisation: it does not count, nor do longer ones.
/// They would give a narrower posterior around a wrong mode.
///
/// @param start first guess instead of the prior's mean, in coordinates; empty = the prior's mean.
/// @throws std::invalid_argument, see WindowErrors and FitLaplace; also if no first guess can be
/// simulated.
CurriculumFit FitCurriculum(std::shared_ptr<const Model> model, std::span<const Rollout> rollouts,
                            const CurriculumOptions& options, const Eigen::VectorXd& start = {});

}  // namespace plumb
