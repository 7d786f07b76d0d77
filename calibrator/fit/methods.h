#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calibrator/fit/curriculum.h"

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

/// What a method has to work with.
struct MethodInput {
  std::shared_ptr<const Model> model;
  std::span<const Rollout> rollouts;
  const CalibrationOptions& options;
  const Eigen::VectorXd start = {};  ///< a first guess, coordinates; empty = the prior's mean
};

/// What it has made of that.
struct MethodResult {
  std::string used;           ///< name of the method that gave the answer
  GaussianMixture posterior;  ///< coordinates
  Eigen::MatrixXd samples;    ///< coordinates, n x N, equally weighted
  Eigen::VectorXd noise_sd;   ///< of each entry of (q, v), physical units; empty = not estimated
  std::optional<CurriculumFit> curriculum;  ///< of laplace, and of what begins with it
  /// effective size of the samples it rests on; NaN = on none
  double ess = std::numeric_limits<double>::quiet_NaN();
  std::string check;  ///< how the shape was verified, in words
  std::vector<std::string> warnings;
  int64_t simulated_steps = 0, failures = 0;
};

/// @throws std::invalid_argument naming the nearest method if there is none of that name.
void RequireMethod(const std::string& name);

/// Runs the method that input.options names. @throws std::invalid_argument if there is none of that
/// name, or the data cannot be used.
MethodResult RunMethod(const MethodInput& input);

}  // namespace plumb
