#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calibrator/fit/curriculum.h"
#include "common/special_numbers.h"

namespace plumb {

/// How to calibrate.
struct CalibrationOptions {
  std::string method = "auto";             ///< one of Methods()
  std::string discrepancy = "likelihood";  ///< of AbcMethods(), see RobotProblem
  /// laplace: control steps of the windows, stage by stage
  std::vector<int> horizons{1, 5, 10, 50};
  /// transitions that reps, simopt, the abc's and mixture may simulate. The abc's begin with a fit
  /// that does not count; mixture takes what its own has left, but 50 samples a round at the least
  int64_t budget = 100'000;
  uint64_t seed = 1;
  bool residual = true;  ///< where the alarm speaks, learn what the model lacks (CloseGap)
  bool replay = false;   ///< play held-out motion open-loop, too
  ExecutionOptions execution;
  std::function<void(const std::string& what, double share)> progress = [](const std::string&,
                                                                           double) {};
};

/// The log and the options that a method works with.
struct MethodInput {
  std::shared_ptr<const Model> model;
  std::span<const Rollout> rollouts;
  const CalibrationOptions& options;
  const Eigen::VectorXd start = {};  ///< a first guess, coordinates; empty = the prior's mean
};

/// The posterior that a method has found, and how.
struct MethodResult {
  std::string used;           ///< name of the method that gave the answer
  GaussianMixture posterior;  ///< coordinates
  Eigen::MatrixXd samples;    ///< coordinates, n x N, equally weighted
  Eigen::VectorXd noise_sd;   ///< of each entry of (q, v), physical units; empty = not estimated
  std::optional<CurriculumFit> curriculum;  ///< of laplace, and of what begins with it
  /// effective size of the samples it rests on; NaN = on none
  double ess = kNaN;
  std::string check;  ///< how the shape was verified, in words
  std::vector<std::string> warnings;
  int64_t simulated_steps = 0, failures = 0;
};

/// A way of calibrating. Thread-safe.
struct Method {
  std::string name;  ///< that --method takes
  std::string help;  ///< one line; docs/inference.md has the same
  MethodResult (*run)(const MethodInput& input);
};

/// Draws of a posterior that a result holds.
inline constexpr Eigen::Index kPosteriorSamples = 1000;

/// Random numbers for these.
Random SampleStream(const MethodInput& input);

/// How the curriculum that a method begins with is fitted.
CurriculumOptions CurriculumOptionsOf(const MethodInput& input);

/// The result of `laplace`.
MethodResult FromCurriculum(const MethodInput& input, CurriculumFit curriculum);

/// k, if only every k-th transition may be looked at so that a search within the budget gets as
/// many simulators as it needs.
int EveryFor(const MethodInput& input, int64_t simulators);

}  // namespace plumb
