#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/gaussian.h"
#include "common/random.h"

namespace plumb {

// The functions here share nothing but a Random that is given: thread-safe apart from that.

/// ln(w_k N(x; m_k, S_k)) of every column of `points` (N) and every component: N x K. @throws
/// std::invalid_argument if a covariance is not positive definite.
Eigen::MatrixXd ComponentLogDensities(const GaussianMixture& mixture,
                                      const Eigen::MatrixXd& points);

/// ln of the sum of every row's exponentials, without overflow; NaN of a row of -infinity alone.
Eigen::VectorXd LogSumExp(const Eigen::MatrixXd& rows);

/// ln p(x) of every column of `points`: the LogSumExp of its components. @throws
/// std::invalid_argument as they do.
Eigen::VectorXd LogDensities(const GaussianMixture& mixture, const Eigen::MatrixXd& points);
double LogDensity(const GaussianMixture& mixture, const Eigen::VectorXd& x);

/// n x count draws; the same as that many calls of Sample() in distribution, not in bits, and much
/// faster.
Eigen::MatrixXd Sample(const GaussianMixture& mixture, Eigen::Index count, Random& random);

/// The distribution of the given coordinates alone, in the order given.
GaussianMixture Marginal(const GaussianMixture& mixture,
                         const std::vector<Eigen::Index>& coordinates);

/// p(x | y) of a mixture over (x, y), y being the last y.size() coordinates (Bishop, "Pattern
/// recognition and machine learning", 2006, eq. 2.81-2.82 for each component): weights w_k N(y;
/// m_k, S_k), normalised, means m_x + S_xy S_yy^-1 (y - m_y), covariances S_xx - S_xy S_yy^-1 S_yx.
/// Components of a weight below `negligible` of the largest are left out. Where y is so far away
/// that every density underflows, the nearest component (by density) is what remains.
GaussianMixture Condition(const GaussianMixture& joint, const Eigen::VectorXd& y,
                          double negligible = 1e-6);

struct MixtureOptions {
  int max_iterations = 200;
  /// Stop when the mean log-likelihood of a sample grows by less than this [nat].
  double tolerance = 1e-5;
  /// Added to every component's covariance: this times the variance of all samples, coordinate by
  /// coordinate.
  double regularisation = 1e-6;
};

/// The mixture that expectation maximisation has found.
struct MixtureFit {
  GaussianMixture mixture;
  std::vector<double> log_likelihood;  ///< mean of a sample [nat], at the start of every iteration
  double bic;  ///< Bayesian information criterion, Schwarz 1978: p ln N - 2 N ln L; lower is better
};

/// Expectation maximisation (Dempster, Laird, Rubin 1977) of weighted samples with full
/// covariances, begun by k-means++ (Arthur & Vassilvitskii, SODA 2007) and a few steps of Lloyd's
/// k-means. Components that lose their samples (fewer than n + 1 by effective number) are removed,
/// so there may be fewer than asked for.
/// @param samples n x N, finite; @param weights N, >= 0, of any positive sum. The effective number
/// of samples, (sum w)^2 / sum w^2, is what BIC calls N.
/// @throws std::invalid_argument for no samples, weights that are no weights, or fewer than one
/// component.
MixtureFit FitMixture(const Eigen::MatrixXd& samples, const Eigen::VectorXd& weights,
                      int components, Random& random, const MixtureOptions& options = {});

/// The number of components (1, 2, 3, 4, 6, 8, 12, 16, ... up to max_components) with the lowest
/// BIC; the search ends once two numbers in a row were no better.
MixtureFit SelectMixture(const Eigen::MatrixXd& samples, const Eigen::VectorXd& weights,
                         int max_components, Random& random, const MixtureOptions& options = {});

}  // namespace plumb
