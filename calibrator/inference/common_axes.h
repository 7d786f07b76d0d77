#pragma once

#include <Eigen/Core>

namespace plumb {

/// Axes along which one covariance is one and another is `ratios`: bound = A A', covariance = A
/// diag(ratios) A' (the symmetric generalised eigenproblem).
struct CommonAxes {
  Eigen::MatrixXd axes;     ///< A, n x n
  Eigen::MatrixXd inverse;  ///< of A
  Eigen::VectorXd ratios;   ///< n, ascending
};

/// @param bound positive definite. @param covariance symmetric, of the same size. Thread-safe.
CommonAxes FindCommonAxes(const Eigen::MatrixXd& bound, const Eigen::MatrixXd& covariance);

}  // namespace plumb
