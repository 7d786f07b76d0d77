#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "calibrator/inference/problem.h"

namespace plumb {

// The functions here share nothing: thread-safe if the given function is, which the caller's thread
// calls.

struct SmcOptions {
  /// in all; a generation that it cuts short is used if half complete
  int64_t simulations = 10'000;
  int population = 500;          ///< accepted simulations of a generation
  double quantile = 0.5;         ///< of the accepted distances: the next generation's epsilon
  double min_acceptance = 1e-2;  ///< stop after a generation that accepted less of its simulations
  double min_change = 1e-3;      ///< stop when epsilon falls by less than this, relatively
  std::string distance = "mahalanobis";  ///< of distances.h
  bool adjust = true;                    ///< regression_adjustment.h on the last generation
  int samples = 10'000;                  ///< of the kernel density on it
};

struct SmcDiagnostics {
  struct Generation {
    double epsilon;       ///< accepted below this
    int64_t simulations;  ///< of this generation
    int accepted;
    double effective;  ///< (sum w)^2 / sum w^2
  };
  std::vector<Generation> generations;
};

/// Approximate Bayesian computation by sequential Monte Carlo (Toni et al., J. Royal Society
/// Interface 6, 2009), in the prior's standard coordinates. Every generation draws from kernels on
/// the one before and accepts outcomes nearer than epsilon, with weights  w_i = p(u_i) / sum_j w_j
/// K(u_i | u_j). Kernels are Gaussian, with the weighted population's covariance, or that of the k
/// = N / 4 nearest (Filippi et al., Statistical Applications in Genetics and Molecular Biology 12,
/// 2013), times the squared bandwidth of Silverman's rule. The scales of the distance are learned
/// anew from all simulations of a generation, accepted or not, and the next epsilon is a quantile
/// of the accepted distances so measured (Prangle, Bayesian Analysis 12, 2017, algorithm 4;
/// Schaelte & Hasenauer's RobustScale).
///
/// Simulations are asked for in batches; of those accepted the earliest *started* make the
/// generation, so that quick simulations are not preferred. Failed ones are never accepted, and are
/// counted. If nothing is ever accepted the posterior is the prior.
/// @throws std::invalid_argument for options that make no sense or if nothing was observed.
Posterior InferBySmc(const Problem& problem, const SmcOptions& options, uint64_t seed,
                     SmcDiagnostics* diagnostics = nullptr);

}  // namespace plumb
