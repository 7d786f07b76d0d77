#include "calibrator/inference/regression_adjustment.h"

#include <cmath>
#include <stdexcept>
#include <vector>

#include "common/decompositions.h"

namespace plumb {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

// Epanechnikov's kernel times the given weights; its width reaches just beyond the farthest finite
// distance.
VectorXd EpanechnikovWeights(const VectorXd& distances, const VectorXd& weights) {
  double farthest = 0;
  for (Index i = 0; i < distances.size(); ++i) {
    if (weights(i) > 0 && std::isfinite(distances(i))) farthest = std::max(farthest, distances(i));
  }
  VectorXd w = VectorXd::Zero(weights.size());
  for (Index i = 0; i < w.size(); ++i) {
    if (!std::isfinite(distances(i))) continue;
    const double relative = farthest > 0 ? distances(i) / farthest : 0;
    w(i) = weights(i) * std::max(0., 1 - relative * relative);
  }
  // All equally far: no kernel to speak of.
  if (!(w.sum() > 0)) {
    for (Index i = 0; i < w.size(); ++i) w(i) = std::isfinite(distances(i)) ? weights(i) : 0;
  }
  if (!(w.sum() > 0))
    throw std::invalid_argument("no simulation is both weighted and a finite distance away");
  return w / w.sum();
}

// Weighted least squares of `targets` (k x N) on `design` (p x N): k x p.
MatrixXd Regress(const MatrixXd& design, const MatrixXd& targets, const VectorXd& w) {
  MatrixXd normal = design * w.asDiagonal() * design.transpose();
  // Statistics that depend on each other leave the adjustment as it is but not its coefficients
  // unique.
  normal.diagonal().tail(normal.rows() - 1).array() += 1e-9;
  return normal.ldlt().solve(design * w.asDiagonal() * targets.transpose()).transpose();
}

}  // namespace

AdjustedSamples AdjustByRegression(const MatrixXd& parameters, const MatrixXd& outcomes,
                                   const VectorXd& observed, const VectorXd& distances,
                                   const VectorXd& weights) {
  const Index count = parameters.cols();
  if (outcomes.cols() != count || distances.size() != count || weights.size() != count ||
      outcomes.rows() != observed.size()) {
    throw std::invalid_argument("regression adjustment: sizes do not match");
  }
  AdjustedSamples result{parameters, EpanechnikovWeights(distances, weights)};
  const VectorXd& w = result.weights;
  std::vector<Index> compared, used;
  for (Index i = 0; i < observed.size(); ++i) {
    if (!std::isnan(observed(i))) compared.push_back(i);
  }
  for (Index j = 0; j < count; ++j) {
    if (w(j) > 0) used.push_back(j);
  }
  const auto m = static_cast<Index>(compared.size());
  if (1 / w.squaredNorm() < 2 * static_cast<double>(m + 1)) return result;

  const VectorXd w_used = w(used);
  MatrixXd design(m + 1, static_cast<Index>(used.size()));
  design.row(0).setOnes();
  design.bottomRows(m) = outcomes(compared, used).colwise() - VectorXd(observed(compared));
  for (Index i = 1; i <= m; ++i) {  // in units of their spread, for the sake of conditioning
    const double spread = std::sqrt(design.row(i).array().square().matrix().dot(w_used));
    if (spread > 0) design.row(i) /= spread;
  }
  const MatrixXd u = parameters(Eigen::all, used);
  const MatrixXd coefficients = Regress(design, u, w_used);
  const MatrixXd residuals = u - coefficients * design;
  result.samples(Eigen::all, used) = residuals.colwise() + coefficients.col(0);
  return result;
}

}  // namespace plumb
