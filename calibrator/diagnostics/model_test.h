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

namespace plumb {

// The functions here share nothing: thread-safe; they use the threads that they are told.

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

/// @throws std::invalid_argument as FitLaplace.
OneStepView ViewOneStep(const MethodInput& input, const MethodResult& result);

/// Whether the model, with the parameters at the posterior's mean, can explain the transitions at
/// all: FindMisspecification on them. @param steps is added the number of simulated ones.
Misspecification TestModel(const MethodInput& input, const MethodResult& result,
                           const OneStepView& view, int64_t* steps);

}  // namespace plumb
