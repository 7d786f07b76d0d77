#include "calibrator/sparse_basis.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <tuple>

namespace plumb {
namespace {

using Belongs = std::function<bool(const Eigen::VectorXd&)>;

constexpr double kEntry = 1e-3;  // of the largest: smaller ones are zero
constexpr int kIterations = 40;

Eigen::Index Entries(const Eigen::VectorXd& x) { return (x.array() != 0).count(); }

// The vector of the space with x_j = 1 and the smallest sum of |x_i|^p, p towards 0.
Eigen::VectorXd Sparse(const Eigen::MatrixXd& space, Eigen::Index j) {
  Eigen::VectorXd x = space * space.row(j).transpose() / space.row(j).squaredNorm();
  double epsilon = 1;
  for (int iteration = 0; iteration < kIterations; ++iteration, epsilon = std::max(0.5 * epsilon, 1e-6)) {
    const Eigen::VectorXd weight = (x.array().square() + epsilon * epsilon).inverse();
    const Eigen::MatrixXd gram = space.transpose() * weight.asDiagonal() * space;
    const Eigen::VectorXd z = gram.ldlt().solve(space.row(j).transpose());
    const double at_j = space.row(j) * z;
    if (!(std::abs(at_j) > 0) || !z.allFinite()) break;
    x = space * z / at_j;
  }
  return x;
}

// Without entries that are next to zero.
Eigen::VectorXd Prune(const Eigen::VectorXd& x) {
  return (x.array().abs() < kEntry * x.cwiseAbs().maxCoeff()).select(0, x);
}

// Integers in proportion to x, if there are small ones that belong; else x with 1 as its first entry.
Eigen::VectorXd Round(const Eigen::VectorXd& x, const Belongs& belongs) {
  double smallest = x.cwiseAbs().maxCoeff();
  Eigen::Index first = 0;
  while (x(first) == 0) ++first;
  for (const double entry : x) {
    if (entry != 0) smallest = std::min(smallest, std::abs(entry));
  }
  for (int least = 1; least <= kLargestInteger; ++least) {
    const Eigen::VectorXd scaled = x * (std::copysign(least, x(first)) / smallest);
    const Eigen::VectorXd rounded = scaled.array().round();
    if (rounded.cwiseAbs().maxCoeff() > kLargestInteger) break;
    if ((scaled - rounded).cwiseAbs().maxCoeff() < 0.1 && belongs(rounded)) return rounded;
  }
  return x / x(first);
}

}  // namespace

std::vector<Eigen::VectorXd> SparseBasis(const Eigen::MatrixXd& space, const Eigen::VectorXd& unit,
                                         const Belongs& belongs) {
  std::vector<Eigen::VectorXd> candidates, chosen;
  const Eigen::Index n = space.rows(), k = space.cols();
  if (k == 0) return chosen;
  const Eigen::MatrixXd orthonormal =
      Eigen::HouseholderQR<Eigen::MatrixXd>(unit.cwiseInverse().asDiagonal() * space).householderQ() *
      Eigen::MatrixXd::Identity(n, k);
  for (Eigen::Index j = 0; j < n; ++j) {
    if (orthonormal.row(j).norm() < kEntry) continue;
    candidates.push_back(Round(unit.cwiseProduct(Prune(Sparse(orthonormal, j))), belongs));
  }
  for (const auto column : orthonormal.colwise()) {  // at worst
    candidates.push_back(Round(unit.cwiseProduct(Prune(column)), belongs));
  }
  std::stable_sort(candidates.begin(), candidates.end(), [](const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
    return std::make_tuple(Entries(a), a.cwiseAbs().sum()) < std::make_tuple(Entries(b), b.cwiseAbs().sum());
  });
  Eigen::MatrixXd basis(n, 0);  // orthonormal, of those chosen
  for (const Eigen::VectorXd& candidate : candidates) {
    const Eigen::VectorXd scaled = candidate.cwiseQuotient(unit);
    const Eigen::VectorXd rest = scaled - basis * (basis.transpose() * scaled).eval();
    if (rest.norm() < 1e-2 * scaled.norm()) continue;
    basis.conservativeResize(Eigen::NoChange, basis.cols() + 1);
    basis.col(basis.cols() - 1) = rest.normalized();
    chosen.push_back(candidate);
    if (basis.cols() == k) break;
  }
  return chosen;
}

}  // namespace plumb
