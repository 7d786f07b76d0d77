#include "calibrator/diagnostics/sparse_basis.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>
#include <utility>

#include "common/decompositions.h"
#include "common/random.h"

namespace plumb {
namespace {

using Belongs = std::function<bool(const Eigen::VectorXd&)>;

constexpr double kEntry = 1e-3;  // of the largest: smaller ones are zero
constexpr double kIndependent =
    0.02;  // of orthonormal columns' rows: what less is left of one does not count
constexpr int kTrials = 100;

Eigen::Index Entries(const Eigen::VectorXd& x) { return (x.array() != 0).count(); }

// Where the first of them is.
Eigen::Index First(const Eigen::VectorXd& x) {
  Eigen::Index first = 0;
  while (x(first) == 0) ++first;
  return first;
}

// k independent rows of a matrix of k columns, the first such in an order drawn at random.
std::vector<Eigen::Index> IndependentRows(const Eigen::MatrixXd& space, Random& random) {
  std::vector<Eigen::Index> order(static_cast<size_t>(space.rows())), chosen;
  std::iota(order.begin(), order.end(), 0);
  Shuffle(order, random);
  Eigen::MatrixXd basis(space.cols(), 0);
  for (const Eigen::Index row : order) {
    const Eigen::VectorXd entries = space.row(row).transpose();
    const Eigen::VectorXd rest = entries - basis * (basis.transpose() * entries).eval();
    if (rest.norm() < kIndependent) continue;
    basis.conservativeResize(Eigen::NoChange, basis.cols() + 1);
    basis.col(basis.cols() - 1) = rest.normalized();
    chosen.push_back(row);
    if (basis.cols() == space.cols()) break;
  }
  return chosen;
}

// Without entries that are next to zero.
Eigen::VectorXd Prune(const Eigen::VectorXd& x) {
  return (x.array().abs() < kEntry * x.cwiseAbs().maxCoeff()).select(0, x);
}

// Integers in proportion to x, if there are small ones that belong; else x with 1 as its first
// entry.
Eigen::VectorXd Round(const Eigen::VectorXd& x, const Belongs& belongs) {
  double smallest = x.cwiseAbs().maxCoeff();
  const Eigen::Index first = First(x);
  for (const double entry : x) {
    if (entry != 0) smallest = std::min(smallest, std::abs(entry));
  }
  for (int least = 1; least <= kLargestInteger; ++least) {
    const Eigen::VectorXd scaled = x * (std::copysign(least, x(first)) / smallest);
    Eigen::VectorXd rounded = scaled.array().round();
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
      FirstColumns(Eigen::HouseholderQR<Eigen::MatrixXd>(unit.cwiseInverse().asDiagonal() * space)
                       .householderQ(),
                   k);
  Random random(0);
  for (int trial = 0; trial < kTrials; ++trial) {
    const std::vector<Eigen::Index> pivots = IndependentRows(orthonormal, random);
    if (static_cast<Eigen::Index>(pivots.size()) < k) continue;
    const Eigen::MatrixXd reduced = orthonormal * Inverse(orthonormal(pivots, Eigen::all));
    for (const auto column : reduced.colwise()) {
      candidates.push_back(Round(unit.cwiseProduct(Prune(column)), belongs));
    }
  }
  for (const auto column : orthonormal.colwise()) {  // at worst
    candidates.push_back(Round(unit.cwiseProduct(Prune(column)), belongs));
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
                     const auto key = [](const Eigen::VectorXd& x) {
                       return std::make_tuple(Entries(x), x.cwiseAbs().sum(), First(x));
                     };
                     return key(a) < key(b);
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
