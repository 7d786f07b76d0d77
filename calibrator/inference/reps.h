#pragma once

#include <Eigen/Core>

#include "common/gaussian.h"

namespace plumb {

// The functions here share nothing: thread-safe.

/// Weights of episodic relative-entropy policy search (Peters, Muelling, Altun, AAAI 2010):
///   w_i = exp((R_i - max R) / eta) / sum
/// with the temperature eta that minimises the dual
///   g(eta) = eta eps + max R + eta ln(1/N sum_i exp((R_i - max R) / eta)),
///   eta >= min_temperature.
/// At the minimum KL(w || 1/N) = eps, which is monotone in eta and solved by bisection in ln eta.
struct RepsWeights {
  Eigen::VectorXd weights;  ///< sum to 1
  double temperature;       ///< eta, in the units of R
  double kl;                ///< KL(w || 1/N) = ln N - H(w)
  double ess;               ///< 1 / sum w^2
};
/// @param returns R_i; -infinity is allowed (an impossible sample gets no weight), NaN is not, and
/// at least one must be finite. Equal returns give equal weights. @throws std::invalid_argument
/// otherwise.
RepsWeights SolveReps(const Eigen::VectorXd& returns, double kl_bound, double min_temperature);

/// The Gaussian that fits weighted samples. The covariance is unbiased (divided by 1 - sum w^2) and
/// shrunk towards `prior`'s by n / (n + ess), because ess samples cannot carry n (n + 1) / 2
/// numbers.
Gaussian FitGaussian(const Eigen::MatrixXd& samples, const RepsWeights& weights,
                     const Gaussian& prior);

/// The Gaussian nearest to `target` on the path of natural parameters from `old` with KL(result ||
/// old) <= kl_bound; `target` itself if it is within the bound. Sample-based REPS bounds only the
/// weights; this bounds the distribution, as eq. 4 of SimOpt (Chebotar et al., ICRA 2019) asks.
Gaussian LimitKl(const Gaussian& old, const Gaussian& target, double kl_bound);

}  // namespace plumb
