#include "calibrator/inference/slopes.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

namespace plumb {
namespace {

using Errors = std::function<Eigen::MatrixXd(const Eigen::MatrixXd&)>;

// Largest share that one observation has of a column's sum of squares.
double LargestShare(const Eigen::VectorXd& column, std::span<const int> block) {
  const double total = column.squaredNorm();
  if (total == 0) return 0;
  double largest = 0, own = 0;
  int before = -1;
  for (Eigen::Index i = 0; i < column.size(); ++i) {
    if (block[static_cast<size_t>(i)] != before) own = 0;
    before = block[static_cast<size_t>(i)];
    own += column(i) * column(i);
    largest = std::max(largest, own);
  }
  return largest / total;
}

// Of two sides of one point. Zero where they are opposite.
Eigen::VectorXd Flatter(const Eigen::VectorXd& forward, const Eigen::VectorXd& backward) {
  const Eigen::ArrayXd f = forward.array(), b = backward.array();
  return (f * b > 0).select((f.abs() < b.abs()).select(f, b), 0.0);
}

// Half of the larger: what the curvature makes of so small a difference is far less.
bool Agree(const Eigen::VectorXd& forward, const Eigen::VectorXd& backward) {
  return (forward - backward).squaredNorm() <
         std::max(forward.squaredNorm(), backward.squaredNorm()) / 4;
}

// By differences to one side of u, of these columns only.
Eigen::MatrixXd OneSided(const Errors& errors, const Eigen::VectorXd& u,
                         const Eigen::VectorXd& at_u, std::span<const Eigen::Index> columns,
                         double difference) {
  Eigen::MatrixXd at = u.replicate(1, static_cast<Eigen::Index>(columns.size()));
  for (size_t k = 0; k < columns.size(); ++k)
    at(columns[k], static_cast<Eigen::Index>(k)) += difference;
  return (errors(at).colwise() - at_u) / difference;
}

std::vector<Eigen::Index> AllOf(const Eigen::VectorXd& u) {
  std::vector<Eigen::Index> all(static_cast<size_t>(u.size()));
  std::iota(all.begin(), all.end(), 0);
  return all;
}

}  // namespace

Eigen::MatrixXd Slopes(const Errors& errors, const Eigen::VectorXd& u, const Eigen::VectorXd& at_u,
                       std::span<const int> block) {
  Eigen::MatrixXd slopes = OneSided(errors, u, at_u, AllOf(u), kSlopeDifference);
  std::vector<Eigen::Index> doubted;
  for (Eigen::Index i = 0; i < u.size(); ++i) {
    if (!slopes.col(i).allFinite() || LargestShare(slopes.col(i), block) > kDominant)
      doubted.push_back(i);
  }
  if (doubted.empty()) return slopes;
  const Eigen::MatrixXd backward = OneSided(errors, u, at_u, doubted, -kSlopeDifference);
  for (Eigen::Index k = 0; k < backward.cols(); ++k) {
    auto forward = slopes.col(doubted[static_cast<size_t>(k)]);
    const bool known = backward.col(k).allFinite();
    if (forward.allFinite()) {
      if (known && !Agree(forward, backward.col(k))) forward = Flatter(forward, backward.col(k));
    } else if (known) {
      forward = backward.col(k);
    } else {
      forward.setZero();
    }
  }
  return slopes;
}

Eigen::MatrixXd CentralSlopes(const Errors& errors, const Eigen::VectorXd& u,
                              const Eigen::VectorXd& at_u, std::span<const int> block,
                              const Eigen::MatrixXd& forward) {
  const Eigen::MatrixXd backward = OneSided(errors, u, at_u, AllOf(u), -kSlopeDifference);
  Eigen::MatrixXd slopes = forward;
  for (Eigen::Index i = 0; i < u.size(); ++i) {
    if (!backward.col(i).allFinite()) continue;
    const bool jumps = !Agree(forward.col(i), backward.col(i)) &&
                       LargestShare(forward.col(i) - backward.col(i), block) > kDominant;
    slopes.col(i) = jumps ? Flatter(forward.col(i), backward.col(i))
                          : Eigen::VectorXd((forward.col(i) + backward.col(i)) / 2);
  }
  return slopes;
}

}  // namespace plumb
