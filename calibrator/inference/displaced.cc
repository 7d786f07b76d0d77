#include "calibrator/inference/displaced.h"

#include "common/decompositions.h"

namespace plumb {

Gaussian Displaced(const Gaussian& prior, const Gaussian& posterior,
                   const Eigen::MatrixXd& displacements) {
  const Eigen::Index n = prior.mean.size();
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(n, n);
  // In coordinates in which the prior is a standard normal.
  const Eigen::LLT<Eigen::MatrixXd> width(prior.covariance);
  const Eigen::MatrixXd half = width.matrixL().solve(posterior.covariance);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(
      Eigen::MatrixXd(width.matrixL().solve(half.transpose())));
  const Eigen::MatrixXd moved =
      axes.eigenvectors().transpose() * width.matrixL().solve(displacements);
  // Along the posterior's axes, each on its own: what the data know, and that times what they say.
  const Eigen::ArrayXd precision = axes.eigenvalues().array().inverse();
  const Eigen::VectorXd known = (precision - 1).max(0);
  const Eigen::VectorXd offset =
      axes.eigenvectors().transpose() * width.matrixL().solve(posterior.mean - prior.mean);
  const Eigen::VectorXd estimate =
      (known.array() > 0).select(precision / known.array() * offset.array(), 0.0);
  // (known^-1 + D D')^-1, by Woodbury's identity, as known may be zero
  const Eigen::MatrixXd told = known.asDiagonal() * moved;
  const Eigen::MatrixXd doubt =
      Eigen::MatrixXd::Identity(moved.cols(), moved.cols()) + moved.transpose() * told;
  const Eigen::MatrixXd left = Eigen::MatrixXd(known.asDiagonal()) -
                               told * Eigen::LLT<Eigen::MatrixXd>(doubt).solve(told.transpose());
  const Eigen::LLT<Eigen::MatrixXd> sum(Eigen::MatrixXd(left + identity));
  const Eigen::MatrixXd back = width.matrixL() * axes.eigenvectors();
  return {prior.mean + back * sum.solve(left * estimate), back * sum.solve(back.transpose())};
}

}  // namespace plumb
