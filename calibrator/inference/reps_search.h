#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <vector>

#include "calibrator/inference/prior.h"
#include "calibrator/inference/reps.h"
#include "common/gaussian.h"

namespace plumb {

/// What the returns R of relative-entropy policy search are.
enum class RepsReturns {
  /// - cost, as eq. 6 of Cui & Hensel has it. The temperature is in the units of the cost, which
  ///   nobody knows.
  kRaw,
  /// - cost mapped to [0, 1] among the samples, as the published implementations do: the
  ///   temperature is a pure number.
  kUnitRange,
  /// ln likelihood + ln prior - ln p_phi. At temperature 1 the weighted samples are the Bayesian
  /// posterior's, so the distribution comes to rest there and its width means something; a higher
  /// one is a step on the way.
  kLogLikelihood,
};

struct RepsOptions {
  RepsReturns returns = RepsReturns::kLogLikelihood;
  int samples = 25;
  int updates = 40;
  /// bound of the weights' and of the distribution's divergence per update [nat]
  double kl = 0.1;
  double min_temperature = 1;  ///< in the units of R; 0.01 for costs in [0, 1]
  double least_ess = 0;        ///< temperature rises until that many samples count; 0 = no floor
  /// 0 = none; d: keep the covariance's shape, scale it by (tr(S^-1 S') / n)^(1/d) (Chebotar)
  double damping = 0;
  /// false: only the weights' divergence is bounded, as most implementations do
  bool bound_distribution = true;
  /// kLogLikelihood: let a quadratic model smooth the returns, see RepsSearch
  bool surrogate = true;
  uint64_t seed = 1;
};

struct RepsRun {
  Gaussian distribution;  ///< p_phi, in the prior's coordinates
  /// of the last update, n x N: with their weights the non-parametric form (section 3)
  Eigen::MatrixXd samples;
  Eigen::VectorXd weights;
  double temperature = 0, ess = 0;
  double kl = 0;  ///< D_KL of each update, summed
  int64_t simulations = 0, failures = 0;
};

/// Relative-entropy policy search from the prior: samples of p_phi are weighted by exp(R /
/// temperature), a Gaussian is fitted to them and moved to as far as the KL bound allows. It works
/// in the prior's own coordinates and takes a uniform prior for the Gaussian of its central 68 %.
/// Costs or log-likelihoods that are not finite are failures, infinitely bad.
///
/// With `surrogate` R is a quadratic of the coordinates, fitted by weighted least squares to all
/// samples so far that p_phi could have drawn (MORE: Abdolmaleki et al., NIPS 2015, section 3, with
/// samples reused), and the Gaussian that follows is exact; where the samples do not determine a
/// concave quadratic, the weighted samples have to do.
/// @param evaluate n x N parameters -> N costs (kRaw, kUnitRange) or log-likelihoods
/// (kLogLikelihood).
/// @param progress told how many updates have been made; may throw.
RepsRun RepsSearch(
    const Prior& prior, const std::function<Eigen::VectorXd(const Eigen::MatrixXd&)>& evaluate,
    const RepsOptions& options, const std::function<void(int)>& progress = [](int) {});

}  // namespace plumb
