#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>

#include "calibrator/inference/prior.h"
#include "common/gaussian.h"

namespace plumb {

/// Many simulations at once: a column of parameters each -> a column of outcomes each. An outcome
/// that is not finite throughout is a failed simulation. `first` counts the simulations of an
/// inference: the one in column j draws its random numbers, if any, from a generator named by
/// (seed, first + j), so that results do not depend on how simulations are spread over threads,
/// machines and restarts.
using Simulate = std::function<Eigen::MatrixXd(const Eigen::MatrixXd& parameters, int64_t first)>;

/// Something to be inferred, where simulations are all there is: of robots or of anything else.
struct Problem {
  Prior prior;
  /// outcome that really happened; an entry that is NaN was not observed
  Eigen::VectorXd observed;
  Simulate simulate;
};

/// The posterior, in the prior's coordinates.
struct Posterior {
  GaussianMixture mixture;  ///< for whoever draws simulators, e.g. the trainer
  /// n x N, equally weighted; more exact than the mixture where they differ
  Eigen::MatrixXd samples;
  int64_t simulations = 0;  ///< made, failed ones included
  int64_t failures = 0;
};

}  // namespace plumb
