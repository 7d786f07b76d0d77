#include "calibrator/inference/sandwich.h"

#include <cmath>

#include "common/decompositions.h"

namespace plumb {

Sandwich WidenBySandwich(const Eigen::MatrixXd& information, const Eigen::MatrixXd& scores,
                         const std::vector<int>& cluster) {
  Sandwich result{information, 1};
  const Eigen::Index n = information.rows();
  const int clusters = cluster.empty() ? 0 : cluster.back() + 1;
  if (clusters < 4 * n) return result;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(information);
  // Only where there is information: H = R R', R n x rank.
  const double least = 1e-12 * eigen.eigenvalues()(n - 1);
  const Eigen::Index rank = (eigen.eigenvalues().array() > least).count();
  if (rank == 0) return result;
  const auto directions = eigen.eigenvectors().rightCols(rank);
  const Eigen::VectorXd root = eigen.eigenvalues().tail(rank).cwiseSqrt();
  const Eigen::MatrixXd whiten = directions * root.cwiseInverse().asDiagonal();
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(clusters, rank);
  for (size_t i = 0; i < cluster.size(); ++i)
    sums.row(cluster[i]) += scores.row(static_cast<Eigen::Index>(i)) * whiten;
  const double c = clusters;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> scatter(
      Eigen::MatrixXd(sums.transpose() * sums * (c / (c - 1))));
  const double edge = 1 + std::sqrt(static_cast<double>(rank) / c);
  const double chance = edge * edge + 3 * std::sqrt(2 / c);
  Eigen::VectorXd kept = Eigen::VectorXd::Ones(rank);
  for (Eigen::Index i = 0; i < rank; ++i) {
    const double ratio = scatter.eigenvalues()(i);
    if (ratio > chance) kept(i) = 1 / ratio;
  }
  result.inflation = 1 / kept.minCoeff();
  const Eigen::MatrixXd shape = directions * root.asDiagonal() * scatter.eigenvectors();
  result.information = shape * kept.asDiagonal() * shape.transpose();
  return result;
}

}  // namespace plumb
