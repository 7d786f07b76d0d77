#pragma once

#include <Eigen/Core>

#include "common/random.h"
#include "robot/residual.h"

namespace plumb {

// Thread-safe, all of it.

/// The regression of k outputs on the same m features, with weights ~ N(0, s^2) and noise: the
/// ratio of the noise's variance to s^2 is each output's own, that of the greatest evidence
/// (MacKay, Neural Computation 4, 1992).
struct ResidualRegression {
  Eigen::VectorXd eigenvalues;   ///< m, of Phi Phi'
  Eigen::MatrixXd eigenvectors;  ///< m x m, columns
  Eigen::MatrixXd projected;     ///< m x k, eigenvectors' Phi y
  Eigen::VectorXd ratio;         ///< k
  Eigen::VectorXd variance;      ///< k, of the noise
  double evidence = 0;           ///< ln, of all outputs

  /// @param features m x N. @param outputs k x N.
  static ResidualRegression Fit(const Eigen::MatrixXd& features, const Eigen::MatrixXd& outputs);
  /// Of other outputs, with the ratios and variances of these.
  ResidualRegression Again(const Eigen::MatrixXd& features, const Eigen::MatrixXd& outputs) const;

  /// k x m: their posterior's mean, and `width` of its standard deviations away from it.
  Eigen::MatrixXd Weights(double width, Random& random) const;
  /// k x N: errors of each column of the outputs, predicted by the regression of the others.
  Eigen::MatrixXd LeftOut(const Eigen::MatrixXd& features, const Eigen::MatrixXd& outputs) const;
};

/// A residual function's features as those of a Gaussian process by some of its inputs: whitened by
/// the Cholesky factor of the kernel between the centres, so that equal weights are equally likely.
class ResidualFeatures {
 public:
  /// The scales of the inputs, and centres that differ as much as `count` of them can: a pivoted
  /// Cholesky decomposition of the kernel of kMiddleLength (Fine and Scheinberg, JMLR 2, 2001).
  /// @param inputs D x N.
  ResidualFeatures(const Eigen::MatrixXd& inputs, int count);

  /// @param length of the kernel, in standard deviations of the inputs.
  void SetLength(double length);
  /// m x N of inputs, D x N.
  Eigen::MatrixXd Of(const Eigen::MatrixXd& inputs) const;
  /// Weights of these as weights of ResidualFunction::Features.
  Eigen::MatrixXd Unwhitened(const Eigen::MatrixXd& weights) const;
  /// Scales, bounds of the inputs and centres; no weights.
  const ResidualFunction& function() const { return function_; }

  static constexpr double kMiddleLength = 4;

 private:
  ResidualFunction unit_, function_;  // of length 1, and of the one that was set
  Eigen::MatrixXd factor_;
};

}  // namespace plumb
