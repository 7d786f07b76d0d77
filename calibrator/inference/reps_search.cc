#include "calibrator/inference/reps_search.h"

#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "calibrator/inference/reps.h"
#include "common/decompositions.h"
#include "common/random.h"
#include "common/special_numbers.h"

namespace plumb {
namespace {

// Features of a quadratic: 1, x_i, x_i x_j with i <= j.
Eigen::Index FeatureCount(Eigen::Index n) { return (n + 1) * (n + 2) / 2; }

Eigen::VectorXd Features(const Eigen::VectorXd& x) {
  const Eigen::Index n = x.size();
  Eigen::VectorXd f(FeatureCount(n));
  Eigen::Index at = 0;
  f(at++) = 1;
  for (Eigen::Index i = 0; i < n; ++i) f(at++) = x(i);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = i; j < n; ++j) f(at++) = x(i) * x(j);
  }
  return f;
}

// The Gaussian exp(quadratic) near `about`, from points with log-densities; empty if it is none.
std::optional<Gaussian> QuadraticFit(const Eigen::MatrixXd& points, const Eigen::VectorXd& values,
                                     const Gaussian& about) {
  const Eigen::Index n = points.rows();
  const Eigen::LLT<Eigen::MatrixXd> factor(about.covariance);
  const Eigen::MatrixXd white = factor.matrixL().solve(points.colwise() - about.mean);
  std::vector<Eigen::Index> near;
  for (Eigen::Index i = 0; i < white.cols(); ++i) {
    if (std::isfinite(values(i)) && white.col(i).squaredNorm() < 3 * static_cast<double>(n + 2))
      near.push_back(i);
  }
  const Eigen::Index count = FeatureCount(n), rows = static_cast<Eigen::Index>(near.size());
  if (rows < count + 3) return {};
  Eigen::MatrixXd design(rows, count);
  Eigen::VectorXd target(rows);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const auto x = white.col(near[static_cast<size_t>(i)]);
    const double weight = std::exp(-0.25 * x.squaredNorm());  // the square root of p_phi's density
    design.row(i) = weight * Features(x).transpose();
    target(i) = weight * values(near[static_cast<size_t>(i)]);
  }
  const auto qr = design.colPivHouseholderQr();
  if (qr.rank() < count) return {};
  const Eigen::VectorXd c = qr.solve(target);
  Eigen::MatrixXd precision(n, n);
  Eigen::Index at = n + 1;
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = i; j < n; ++j, ++at)
      precision(i, j) = precision(j, i) = i == j ? -2 * c(at) : -c(at);
  }
  const Eigen::LLT<Eigen::MatrixXd> curvature(precision);
  if (curvature.info() != Eigen::Success) return {};
  const Eigen::VectorXd mean = curvature.solve(c.segment(1, n));
  const Eigen::MatrixXd root = factor.matrixL();
  const Eigen::MatrixXd covariance =
      root * curvature.solve(Eigen::MatrixXd::Identity(n, n)) * root.transpose();
  return Gaussian{about.mean + root * mean, (covariance + covariance.transpose()) / 2};
}

Eigen::VectorXd UnitRange(const Eigen::VectorXd& costs) {
  double low = kInfinity, high = -kInfinity;
  for (const double cost : costs) {
    if (std::isfinite(cost)) low = std::min(low, cost), high = std::max(high, cost);
  }
  if (!std::isfinite(low)) return Eigen::VectorXd::Constant(costs.size(), -kInfinity);
  return -(costs.array() - low) / std::max(high - low, std::numeric_limits<double>::min());
}

}  // namespace

RepsSearch::RepsSearch(Gaussian prior, const RepsOptions& options, RepsState state)
    : prior_(std::move(prior)), options_(options), state_(std::move(state)) {}

Eigen::MatrixXd RepsSearch::Samples() const {
  Eigen::MatrixXd normals(prior_.mean.size(), options_.samples);
  for (Eigen::Index i = 0; i < normals.cols(); ++i) {
    Random random(options_.seed, {options_.stream, static_cast<uint32_t>(state_.update),
                                  static_cast<uint32_t>(i)});
    for (Eigen::Index j = 0; j < normals.rows(); ++j) normals(j, i) = random.Normal();
  }
  return Transform(state_.distribution, normals);
}

bool RepsSearch::Update(const Eigen::VectorXd& values) {
  const bool likelihood = options_.returns == RepsReturns::kLogLikelihood;
  const Eigen::MatrixXd samples = Samples();
  ++state_.update;
  const auto finite = values.array().isFinite();
  state_.failures += values.size() - finite.count();
  if (!finite.any()) return false;
  const Gaussian before = state_.distribution;
  Eigen::VectorXd returns;
  std::optional<Gaussian> target;
  if (likelihood) {
    Eigen::VectorXd densities = finite.select(values, -kInfinity);
    for (Eigen::Index i = 0; i < densities.size(); ++i)
      densities(i) += LogDensity(prior_, samples.col(i));
    returns = densities;
    for (Eigen::Index i = 0; i < returns.size(); ++i)
      returns(i) -= LogDensity(before, samples.col(i));
    Remember(samples, densities);
    target = QuadraticFit(state_.points, state_.densities, before);
  } else {
    returns = UnitRange(finite.select(values, kInfinity));
  }
  const RepsWeights weights = SolveReps(returns, options_.kl, options_.min_temperature);
  if (!target) target = FitGaussian(samples, weights, before);
  state_.distribution = LimitKl(before, *target, options_.kl);
  state_.kl += KlDivergence(state_.distribution, before);
  state_.temperature = weights.temperature;
  state_.ess = weights.ess;
  return true;
}

void RepsSearch::Remember(const Eigen::MatrixXd& samples, const Eigen::VectorXd& densities) {
  state_.points.conservativeResize(samples.rows(), state_.points.cols() + samples.cols());
  state_.points.rightCols(samples.cols()) = samples;
  state_.densities.conservativeResize(state_.densities.size() + densities.size());
  state_.densities.tail(densities.size()) = densities;
}

Gaussian CentralGaussian(const Prior& prior) {
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(prior.size()),
                        one = Eigen::VectorXd::Ones(prior.size());
  const Eigen::VectorXd width = (prior.FromStandard(one) - prior.FromStandard(-one)) / 2;
  return {prior.FromStandard(zero), width.array().square().matrix().asDiagonal()};
}

RepsState SearchByReps(const Prior& prior,
                       const std::function<Eigen::VectorXd(const Eigen::MatrixXd&)>& evaluate,
                       const RepsOptions& options, int updates,
                       const std::function<void(int)>& progress) {
  const Gaussian begin = CentralGaussian(prior);
  RepsSearch search(begin, options, {0, begin});
  while (search.state().update < updates) {
    search.Update(evaluate(search.Samples()));
    progress(search.state().update);
  }
  return search.state();
}

}  // namespace plumb
