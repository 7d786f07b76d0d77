#pragma once

#include <optional>

#include "calibrator/inference/problem.h"
#include "calibrator/inference/regression_adjustment.h"
#include "common/random.h"

namespace plumb {

/// What approximate Bayesian computation ends with: `count` draws of the density that weighted
/// samples have (KernelDensity), and a mixture fitted to them (SelectMixture). Simulations and
/// failures stay 0. Thread-safe.
/// @param kept in standard coordinates; fewer than n + 2 tell no covariance, and the prior stays.
Posterior AbcPosterior(const Prior& prior, const std::optional<AdjustedSamples>& kept, int count,
                       Random& random);

}  // namespace plumb
