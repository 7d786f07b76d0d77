#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "calibrator/diagnostics/misspecification.h"
#include "calibrator/fit/method.h"
#include "calibrator/fit/window_errors.h"
#include "calibrator/inference/laplace.h"
#include "common/batch_runner.h"

namespace plumb {

// The functions here share nothing: thread-safe; they use the threads that they are told.

/// A fit, and the one-step errors that it has left. What it refers to must outlive it.
struct TestedFit {
  std::shared_ptr<const Model> model;
  std::span<const Rollout> rollouts;
  const GaussianMixture& posterior;         ///< coordinates
  const LaplaceFit& one_step;               ///< errors and slopes at the mean
  std::span<const WindowErrors::Row> rows;  ///< what its errors are about
  /// of each entry of (q, v), as estimated or as recorded, physical units
  Eigen::VectorXd noise_sd;
  bool noise_known;
};

/// What a fit's errors say of its model.
struct ModelTest {
  Misspecification found;
  /// The posterior as wide as what may be wrong makes it, coordinates. Each candidate that would
  /// explain errors takes the parameters elsewhere if it changes: the data's estimate, in each
  /// component, is Displaced by that, times the root of the share of the best one's gain that its
  /// own is. Which of the candidates it is, if it is one, is not known. Where nobody can tell
  /// whether the model is right, candidates are those that would explain all errors.
  GaussianMixture considered;
};

/// Whether the model can explain the log at all, whatever its parameters: FindMisspecification of
/// the fit's errors, with every parameter that the simulator knows and the robot does not fit for a
/// candidate.
///
/// Errors are whitened as if simulators were linear over the noise of the states that transitions
/// begin with. If these are noisy and there is an alarm, it may be that which is wrong: then
/// Witnesses alone are asked again, with their own noise (and PredictStarts): theirs is the
/// answer. Fewer than kFewestWitnesses give none: no alarm, and the summary says so.
/// @param simulated_steps is added to. @throws std::invalid_argument if sizes do not fit together.
ModelTest TestModel(const TestedFit& fit, ExecutionOptions execution, int64_t* simulated_steps);

inline constexpr int kFewestWitnesses = 50;

/// One-step errors of a posterior's mean, their noise and their slopes, whatever method has found
/// it.
struct OneStepView {
  LaplaceFit fit;
  std::vector<WindowErrors::Row> rows;  ///< of its errors
  Eigen::VectorXd noise_sd;             ///< of each entry of (q, v), physical units
  bool noise_known = false;
  Eigen::MatrixXd information;  ///< that the posterior rests on
  int64_t simulated_steps = 0;
};

/// Mean of the squared errors, whitened by the noise as it was recorded: 1 = down to the noise; NaN
/// where nobody knows it. Thread-safe.
double MeanSquaredError(const OneStepView& view);

/// @throws std::invalid_argument as FitLaplace.
OneStepView ViewOneStep(const MethodInput& input, const MethodResult& result);

/// TestModel of a method's result.
ModelTest TestModel(const MethodInput& input, const MethodResult& result, const OneStepView& view,
                    int64_t* simulated_steps);

}  // namespace plumb
