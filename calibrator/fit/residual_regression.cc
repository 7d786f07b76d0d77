#include "calibrator/fit/residual_regression.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "common/decompositions.h"

namespace plumb {
namespace {

constexpr double kStill = 1e-9;         // an input's sd below which it does not move
constexpr double kLeastFreedom = 1e-3;  // 1 - leverage of a column

ResidualRegression Project(const Eigen::MatrixXd& features, const Eigen::MatrixXd& outputs) {
  ResidualRegression r;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      Eigen::MatrixXd(features * features.transpose()));
  r.eigenvalues = eigen.eigenvalues().cwiseMax(0);
  r.eigenvectors = eigen.eigenvectors();
  r.projected = r.eigenvectors.transpose() * (features * outputs.transpose());
  return r;
}

// ln evidence of an output, the noise's variance at its best.
double Evidence(const ResidualRegression& r, Eigen::Index k, double square, double count,
                double ratio, double* variance) {
  const Eigen::ArrayXd spread = r.eigenvalues.array() + ratio;
  const double rest = square - (r.projected.col(k).array().square() / spread).sum();
  *variance = std::max(rest / count, 1e-300);
  return -0.5 * (count * std::log(2 * std::numbers::pi * *variance) + count +
                 (spread / ratio).log().sum());
}

// Of the points, in whose metric lengths are 1, those of which a pivoted Cholesky decomposition
// begins.
Eigen::MatrixXd Pivots(const Eigen::MatrixXd& points, Eigen::Index count) {
  Eigen::VectorXd left = Eigen::VectorXd::Ones(points.cols());
  Eigen::MatrixXd factor(points.cols(), count), chosen(points.rows(), count);
  for (Eigen::Index k = 0; k < count; ++k) {
    Eigen::Index pivot;
    const double rest = left.maxCoeff(&pivot);
    chosen.col(k) = points.col(pivot);
    const Eigen::ArrayXd squares = (points.colwise() - points.col(pivot)).colwise().squaredNorm();
    Eigen::VectorXd column = (-squares / 2).exp();
    column.noalias() -= factor.leftCols(k) * factor.row(pivot).head(k).transpose();
    column /= std::sqrt(std::max(rest, ResidualFunction::kNugget));
    left -= column.cwiseAbs2();
    factor.col(k) = column;
  }
  return chosen;
}

}  // namespace

ResidualRegression ResidualRegression::Fit(const Eigen::MatrixXd& features,
                                           const Eigen::MatrixXd& outputs) {
  ResidualRegression r = Project(features, outputs);
  r.ratio.resize(outputs.rows()), r.variance.resize(outputs.rows());
  const auto count = static_cast<double>(outputs.cols());
  for (Eigen::Index k = 0; k < outputs.rows(); ++k) {
    const double square = outputs.row(k).squaredNorm();
    double best = -std::numeric_limits<double>::infinity();
    for (int quarters = -16; quarters <= 24; ++quarters) {  // of a decade
      const double ratio = std::pow(10.0, quarters / 4.0);
      double variance;
      const double evidence = Evidence(r, k, square, count, ratio, &variance);
      if (evidence > best) best = evidence, r.ratio(k) = ratio, r.variance(k) = variance;
    }
    r.evidence += best;
  }
  return r;
}

ResidualRegression ResidualRegression::Again(const Eigen::MatrixXd& features,
                                             const Eigen::MatrixXd& outputs) const {
  ResidualRegression r = Project(features, outputs);
  r.ratio = ratio, r.variance = variance;
  return r;
}

Eigen::MatrixXd ResidualRegression::Weights(double width, Random& random) const {
  Eigen::MatrixXd weights(ratio.size(), eigenvalues.size());
  for (Eigen::Index k = 0; k < weights.rows(); ++k) {
    const Eigen::VectorXd inverse = (eigenvalues.array() + ratio(k)).inverse();
    Eigen::VectorXd rotated = inverse.cwiseProduct(projected.col(k));
    if (width > 0) {
      for (Eigen::Index i = 0; i < rotated.size(); ++i)
        rotated(i) += width * std::sqrt(variance(k) * inverse(i)) * random.Normal();
    }
    weights.row(k) = (eigenvectors * rotated).transpose();
  }
  return weights;
}

Eigen::MatrixXd ResidualRegression::LeftOut(const Eigen::MatrixXd& features,
                                            const Eigen::MatrixXd& outputs) const {
  const Eigen::MatrixXd rotated = eigenvectors.transpose() * features;
  Eigen::MatrixXd left_out(outputs.rows(), outputs.cols());
  for (Eigen::Index k = 0; k < outputs.rows(); ++k) {
    const Eigen::ArrayXd inverse = (eigenvalues.array() + ratio(k)).inverse();
    const Eigen::RowVectorXd fitted =
        (inverse * projected.col(k).array()).matrix().transpose() * rotated;
    const Eigen::RowVectorXd leverage =
        (rotated.array().square().colwise() * inverse).colwise().sum();
    left_out.row(k) = (outputs.row(k) - fitted).array() / (1 - leverage.array()).max(kLeastFreedom);
  }
  return left_out;
}

ResidualFeatures::ResidualFeatures(const Eigen::MatrixXd& inputs, int count) {
  unit_.mean = inputs.rowwise().mean();
  unit_.scale = (inputs.colwise() - unit_.mean).rowwise().norm() /
                std::sqrt(static_cast<double>(inputs.cols()));
  unit_.scale = (unit_.scale.array() > kStill).select(unit_.scale, 1.0);
  const Eigen::MatrixXd z =
      unit_.scale.cwiseInverse().asDiagonal() * (inputs.colwise() - unit_.mean).eval();
  unit_.low = z.rowwise().minCoeff(), unit_.high = z.rowwise().maxCoeff();
  const Eigen::Index centres = std::min<Eigen::Index>(count, z.cols());
  unit_.centres = kMiddleLength * Pivots(z / kMiddleLength, centres).transpose();
  SetLength(kMiddleLength);
}

void ResidualFeatures::SetLength(double length) {
  function_ = unit_;
  function_.scale *= length;
  function_.low /= length, function_.high /= length, function_.centres /= length;
  factor_ = function_.KernelFactor();
}

Eigen::MatrixXd ResidualFeatures::Of(const Eigen::MatrixXd& inputs) const {
  Eigen::MatrixXd features(function_.features(), inputs.cols());
  ResidualFunction::Work work = function_.MakeWork();
  for (Eigen::Index i = 0; i < inputs.cols(); ++i) {
    function_.Features(inputs.col(i), &work);
    features.col(i) = work.features.head(features.rows()).cast<double>();
  }
  auto bumps = features.bottomRows(function_.centres.rows());
  factor_.triangularView<Eigen::Lower>().solveInPlace(bumps);
  return features;
}

Eigen::MatrixXd ResidualFeatures::Unwhitened(const Eigen::MatrixXd& weights) const {
  Eigen::MatrixXd result = weights;
  auto bumps = result.rightCols(function_.centres.rows());
  factor_.triangularView<Eigen::Lower>().solveInPlace<Eigen::OnTheRight>(bumps);
  return result;
}

}  // namespace plumb
