#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <limits>
#include <vector>

#include "calibrator/inference/prior.h"
#include "common/gaussian.h"

namespace plumb {

// The functions here share nothing: thread-safe if the given function is, which the caller's thread
// calls.

/// Data explained up to noise: errors(parameters) would be independent, with mean zero and equal
/// variance within each group, for the right parameters.
struct LeastSquares {
  Prior prior;
  /// n x N parameters, in the prior's coordinates -> rows x N errors. A column that is not finite
  /// is a failed simulation.
  std::function<Eigen::MatrixXd(const Eigen::MatrixXd& parameters)> errors;
  std::vector<int> group;  ///< of each row, from 0: rows that share a noise scale
  /// of each row, ascending from 0: rows of one observation, outliers together or not at all
  std::vector<int> block;
  std::vector<int> cluster;  ///< of each row, ascending from 0: rows that may depend on each other
  /// errors are whitened already: their variance is one, or more if the data insist
  bool scale_known = false;
};

struct LaplaceOptions {
  int max_iterations = 50;
  double tolerance = 0.02;  ///< ends when a step is below that many posterior standard deviations
  bool robust = true;       ///< Student's t where errors have its tails
  bool sandwich = true;     ///< wider where errors of a cluster are correlated
  /// else the one of the last step but one, which saves n simulations
  bool jacobian_at_end = true;
};

struct LaplaceFit {
  Eigen::VectorXd mode;         ///< n, in the prior's coordinates
  Gaussian posterior;           ///< in the prior's coordinates; bounded ones to first order
  Gaussian standard;            ///< the same in standard coordinates, where it is a Gaussian
  Eigen::MatrixXd information;  ///< of the data alone about the prior's coordinates, n x n
  Eigen::VectorXd errors;       ///< rows: at the mode, divided by the noise's scale
  Eigen::MatrixXd jacobian;     ///< rows x n, of these
  Eigen::VectorXd scale;        ///< of each group's noise
  /// of Student's t; infinite = normal
  double degrees_of_freedom = std::numeric_limits<double>::infinity();
  /// at the mode, up to a constant of the data, noise scale maximised
  double log_posterior = 0;
  /// largest ratio of variances by which correlated errors have widened the posterior
  double inflation = 1;
  int64_t simulations = 0;  ///< parameters tried
  bool converged = false;
};

/// Laplace's approximation of the posterior: the mode by Levenberg and Marquardt's method in
/// standard coordinates, where the prior is one more residual |u|^2 and no parameter has bounds,
/// with a Jacobian by Slopes, kept up by Broyden's formula while steps are short; around it a
/// Gaussian of the curvature J'J / s^2 + 1.
///
/// The scale s of each group's noise is estimated along the way, s^2 = sum r^2 / (N - d_eff N /
/// N_all), which also damps the first steps: far from the mode noise seems large. It is never taken
/// for less than 1e-9: choose units accordingly. Groups of fewer than 20 rows share one scale.
/// Where the scale is known, it counts as 20 errors of variance one, and is one at least.
///
/// robust: blocks of k errors are Student's t, weight (f + k) / (f + |r/s|^2) (Lange, Little,
/// Taylor, JASA 84, 1989), with f chosen by likelihood among {2, 4, 8, 16, 32, infinity}. sandwich:
/// where the scores of clusters scatter more than the curvature says, significantly, the covariance
/// is widened in these directions to H^-1 S H^-1 (White, Econometrica 50, 1982; clusters: Liang,
/// Zeger, Biometrika 73, 1986), never narrowed.
///
/// @param start in the prior's coordinates.
/// @throws std::invalid_argument if the sizes of the problem do not fit, the start is not within
/// the prior's bounds or its simulation fails, or there are too few errors to tell noise from
/// parameters: n + 3 at least, where the scale is not known.
LaplaceFit FitLaplace(const LeastSquares& problem, const Eigen::VectorXd& start,
                      const LaplaceOptions& options = {});

/// ln likelihood of N parameters with the noise's scale at its maximum for each, up to a constant;
/// -infinity where the simulation fails. Where the record knows the scale, it counts as in
/// FitLaplace.
/// @param degrees_of_freedom of Student's t; infinite = normal. @param parameters n x N, in the
/// prior's coordinates.
Eigen::VectorXd LogLikelihood(const LeastSquares& problem, const Eigen::MatrixXd& parameters,
                              double degrees_of_freedom = std::numeric_limits<double>::infinity());

/// Draws from the posterior, n x count in the prior's coordinates.
Eigen::MatrixXd Draw(const LaplaceFit& fit, const Prior& prior, Eigen::Index count, Random& random);

}  // namespace plumb
