#pragma once

#include <Eigen/Core>

namespace plumb {

// The functions here share nothing: thread-safe.

/// Parameters moved to where they would be had their simulations come out as observed.
struct AdjustedSamples {
  Eigen::MatrixXd samples;  ///< n x N
  Eigen::VectorXd weights;  ///< N, sum to 1; 0 for simulations at or beyond the largest distance
};

/// Regression adjustment of approximate Bayesian computation. With weights w_i = v_i (1 - (d_i /
/// d_max)^2) (Epanechnikov), fits u = a + B (s - observed) + e by weighted least squares and
/// returns u_i - B (s_i - observed) (Beaumont, Zhang & Balding, Genetics 162, 2002, eq. 3-5).
///
/// @param parameters n x N in standard coordinates: no bounds to be crossed. @param outcomes m x N,
/// finite where `distances` is; entries of `observed` that are NaN are not used. @param distances
/// N, >= 0, infinite for failures.
/// @param weights N, >= 0: v_i, e.g. importance weights. With fewer than 2 (m + 1) effective
/// samples nothing can be regressed, and parameters are returned unmoved. @throws
/// std::invalid_argument if no simulation has both weight and a finite distance, or sizes do not
/// match.
AdjustedSamples AdjustByRegression(const Eigen::MatrixXd& parameters,
                                   const Eigen::MatrixXd& outcomes, const Eigen::VectorXd& observed,
                                   const Eigen::VectorXd& distances,
                                   const Eigen::VectorXd& weights);

}  // namespace plumb
