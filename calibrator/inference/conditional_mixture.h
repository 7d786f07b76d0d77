#pragma once

#include <cstdint>
#include <vector>

#include "calibrator/inference/problem.h"

namespace plumb {

// The functions here share nothing: thread-safe if the given function is, which the caller's thread
// calls.

struct ConditionalMixtureOptions {
  int64_t simulations = 10'000;  ///< in all
  int rounds = 6;                ///< the first draws from the prior
  /// Share of a component of the posterior's estimate that may lie outside of the region parameters
  /// are drawn from.
  double truncation = 1e-4;
  /// Effective number of simulations, as a share of those in the region, that the region's estimate
  /// is made of.
  double local_share = 0.05;
  int max_components = 48;  ///< of the joint distribution's mixture
  int samples = 10'000;     ///< of the posterior, drawn at the end
};

/// The course of an inference, round by round.
struct ConditionalMixtureDiagnostics {
  struct Round {
    int64_t simulations;  ///< so far
    int64_t inside;       ///< those that succeeded with parameters in the region drawn from
    double effective;     ///< (sum w)^2 / sum w^2 of the kernel's weights
    int components;       ///< of the joint distribution
    bool truncated;       ///< whether the next round draws from a smaller region than the prior's
  };
  std::vector<Round> rounds;
  /// ln p(parameters | outcome) [nat] of simulations left out, for kernels of an effective 1, 1/2,
  /// 1/4, 1/8, 1/16 of the simulations inside; fewer where there are too few. Shows which widths
  /// were good.
  std::vector<double> held_out;
};

/// Likelihood-free inference without a neural network: the joint distribution of parameters (in the
/// prior's standard coordinates) and outcomes is a mixture of Gaussians, which is conditioned on
/// what was observed.
///
/// Simulations are made in rounds, from the prior truncated to where the posterior may be
/// (TruncatedPrior). As truncation changes neither the likelihood nor the prior's shape,
/// simulations of all rounds that lie in the region count alike, no importance weights are needed,
/// and several modes stay several modes. The mixture is fitted to simulations weighted by a
/// Gaussian kernel around the observed outcome, in the Mahalanobis distance of the outcomes in the
/// region: weights that depend on outcomes only leave p(parameters | outcome) as it is but make the
/// mixture spend its components where it will be conditioned, and make local regression (Beaumont,
/// Zhang & Balding, Genetics 162, 2002) of every component. The region of the next round holds this
/// kernel's whole neighbourhood, not only the posterior, so that the regressions see outcomes on
/// all sides. At the end several widths are tried and those that predict best the parameters of
/// simulations left out, near the observed outcome (3 folds, logarithmic score, which punishes
/// false certainty), are pooled.
///
/// Failed simulations are counted and have no weight. Statistics that do not vary say nothing and
/// are harmless. Without enough successes (10 per coordinate of parameters and outcomes) a round
/// learns nothing, and the posterior is the prior.
/// @throws std::invalid_argument for options that make no sense or if nothing was observed.
Posterior InferConditionalMixture(const Problem& problem, const ConditionalMixtureOptions& options,
                                  uint64_t seed,
                                  ConditionalMixtureDiagnostics* diagnostics = nullptr);

}  // namespace plumb
