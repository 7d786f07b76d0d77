#pragma once

#include <Eigen/Core>
#include <functional>

#include "common/decompositions.h"

namespace plumb {

/// A Kalman filter whose motion is any function: the scaled unscented transform carries mean and
/// covariance through it (Julier, Uhlmann, "Unscented filtering and nonlinear estimation", Proc.
/// IEEE 92, 2004; Julier, "The scaled unscented transformation", ACC 2002), with the parameters of
/// Wan and van der Merwe ("The unscented Kalman filter for nonlinear estimation", AS-SPCC 2000).
/// Readings are linear in the state, so that no transform is needed for them: the correction is the
/// Kalman filter's own.
///
/// Nothing allocates after construction, for up to 32 states. Not thread-safe.
class UnscentedFilter {
 public:
  /// Spread of the sigma points about the mean, in [1e-4, 1]. At 1, and kKappa = 0, they are
  /// sqrt(size) standard deviations away and none has a negative weight, so that a covariance is
  /// positive semidefinite whatever the motion does to it; a small one, next to the mean, would see
  /// nothing of a contact that is near.
  static constexpr double kAlpha = 1;
  static constexpr double kBeta = 2;  ///< best for a Gaussian
  static constexpr double kKappa = 0;

  explicit UnscentedFilter(Eigen::Index size);

  Eigen::Index size() const { return mean_.size(); }
  const Eigen::VectorXd& mean() const { return mean_; }
  const Eigen::MatrixXd& covariance() const { return covariance_; }

  /// Starts anew with independent states. @param sd >= 0.
  void Restart(const Eigen::Ref<const Eigen::VectorXd>& mean,
               const Eigen::Ref<const Eigen::VectorXd>& sd);

  /// Moves a state, which is finite, to where it will be. @return false if that cannot be told.
  using Motion = std::function<bool(Eigen::Ref<Eigen::VectorXd> state)>;
  /// @param noise covariance of what the motion does not know, added to it.
  /// @return false, with the filter as it was, if the motion fails for a sigma point, the mean is
  /// not finite or the covariance is not positive definite.
  bool Predict(const Motion& motion, const Eigen::MatrixXd& noise);

  /// A reading less its prediction, and the variance of that if filter and noise are right.
  struct Innovation {
    double value, variance;
  };
  /// Of a reading that is row . state + white noise.
  Innovation Expect(const Eigen::VectorXd& row, double value, double variance);
  /// Takes it into account: Joseph's form, which keeps the covariance symmetric and positive.
  void Correct(const Eigen::VectorXd& row, double value, double variance);

 private:
  Eigen::VectorXd mean_, gain_;
  Eigen::VectorXd shared_;  // covariance of the state with the last reading
  Eigen::MatrixXd covariance_;
  Eigen::LLT<Eigen::MatrixXd> root_;
  Eigen::MatrixXd points_;  // sigma points, then their weighted deviations from the mean
};

}  // namespace plumb
