#include "estimator/model/unscented_filter.h"

#include <cmath>

namespace plumb {

UnscentedFilter::UnscentedFilter(Eigen::Index size)
    : mean_(Eigen::VectorXd::Zero(size)),
      gain_(size),
      shared_(size),
      covariance_(Eigen::MatrixXd::Zero(size, size)),
      root_(size),
      points_(size, 2 * size + 1) {}

void UnscentedFilter::Restart(const Eigen::Ref<const Eigen::VectorXd>& mean,
                              const Eigen::Ref<const Eigen::VectorXd>& sd) {
  mean_ = mean;
  covariance_.setZero();
  covariance_.diagonal() = sd.array().square();
}

bool UnscentedFilter::Predict(const Motion& motion, const Eigen::MatrixXd& noise) {
  const Eigen::Index n = size();
  root_.compute(covariance_);
  if (root_.info() != Eigen::Success) return false;
  const auto dimension = static_cast<double>(n);
  const double spread = kAlpha * std::sqrt(dimension + kKappa);  // sqrt(dimension + lambda)
  points_.col(0) = mean_;
  for (Eigen::Index i = 0; i < n; ++i) {
    points_.col(1 + i) = points_.col(1 + n + i) = mean_;
    points_.col(1 + i).tail(n - i) += spread * root_.matrixLLT().col(i).tail(n - i);
    points_.col(1 + n + i).tail(n - i) -= spread * root_.matrixLLT().col(i).tail(n - i);
  }
  if (!points_.allFinite()) return false;
  for (Eigen::Index i = 0; i < points_.cols(); ++i) {
    if (!motion(points_.col(i))) return false;
  }
  const double lambda = spread * spread - dimension, others = 0.5 / (dimension + lambda),
               first = lambda / (dimension + lambda);
  mean_ = first * points_.col(0);
  for (Eigen::Index i = 1; i < points_.cols(); ++i) mean_ += others * points_.col(i);
  points_.colwise() -= mean_;
  points_.col(0) *= std::sqrt(first + 1 - kAlpha * kAlpha + kBeta);
  points_.rightCols(2 * n) *= std::sqrt(others);
  covariance_ = noise;
  // a product of this size by blocks would allocate
  covariance_ += points_.lazyProduct(points_.transpose());
  return true;
}

UnscentedFilter::Innovation UnscentedFilter::Expect(const Eigen::VectorXd& row, double value,
                                                    double variance) {
  shared_.noalias() = covariance_ * row;
  return {value - row.dot(mean_), row.dot(shared_) + variance};
}

void UnscentedFilter::Correct(const Eigen::VectorXd& row, double value, double variance) {
  const Innovation innovation = Expect(row, value, variance);
  gain_ = shared_ / innovation.variance;
  mean_ += gain_ * innovation.value;
  // (1 - K h') P (1 - K h')' + K R K', one factor after the other, for a reading that is one
  // number.
  covariance_.noalias() -= gain_ * shared_.transpose();
  shared_.noalias() = covariance_ * row;
  covariance_.noalias() -= shared_ * gain_.transpose();
  covariance_.noalias() += (variance * gain_) * gain_.transpose();
  covariance_.triangularView<Eigen::StrictlyUpper>() = covariance_.transpose();
}

}  // namespace plumb
