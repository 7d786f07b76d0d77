#include "calibrator/inference/common_axes.h"

#include "common/decompositions.h"

namespace plumb {

CommonAxes FindCommonAxes(const Eigen::MatrixXd& bound, const Eigen::MatrixXd& covariance) {
  const Eigen::LLT<Eigen::MatrixXd> factor(bound);
  const Eigen::MatrixXd half = factor.matrixL().solve(covariance);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      Eigen::MatrixXd(factor.matrixL().solve(half.transpose())));
  const Eigen::Index n = bound.rows();
  return {
      factor.matrixL() * eigen.eigenvectors(),
      eigen.eigenvectors().transpose() * factor.matrixL().solve(Eigen::MatrixXd::Identity(n, n)),
      eigen.eigenvalues()};
}

}  // namespace plumb
