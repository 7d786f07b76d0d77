#pragma once

#include <cstdint>
#include <string>

#include "calibrator/inference/problem.h"

namespace plumb {

// The functions here share nothing: thread-safe if the given function is, which the caller's thread
// calls.

struct RejectionOptions {
  int64_t simulations = 10'000;
  double fraction = 0.01;                ///< kept: the nearest, of all simulations
  std::string distance = "mahalanobis";  ///< of distances.h, with scales RobustScale
  bool adjust = true;                    ///< regression_adjustment.h, if there are enough
  int samples = 10'000;                  ///< of the kernel density on those kept
  int64_t batch = 1'000;                 ///< simulations asked for at once
};

struct RejectionDiagnostics {
  double epsilon = 0;  ///< the largest distance kept
  int64_t kept = 0;
};

/// Approximate Bayesian computation by rejection (Pritchard et al., Molecular Biology and Evolution
/// 16, 1999): simulates draws of the prior and keeps those whose outcomes are nearest to the
/// observed one. The baseline other methods must beat. Failed simulations are never kept; where
/// fewer than n + 2 are, the posterior is the prior (AbcPosterior).
/// @throws std::invalid_argument for options that make no sense or if nothing was observed.
Posterior InferByRejection(const Problem& problem, const RejectionOptions& options, uint64_t seed,
                           RejectionDiagnostics* diagnostics = nullptr);

}  // namespace plumb
