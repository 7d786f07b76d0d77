#include "calibrator/inference/reps_search.h"

#include <cmath>
#include <limits>
#include <optional>

#include "common/decompositions.h"

namespace plumb {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

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

// The temperature rises until enough samples count.
RepsWeights Solve(const Eigen::VectorXd& returns, const RepsOptions& options) {
  RepsWeights weights = SolveReps(returns, options.kl, options.min_temperature);
  const double floor = std::min(options.least_ess, 0.9 * static_cast<double>(returns.size()));
  for (double hotter = weights.temperature; weights.ess < floor && hotter < 1e300;) {
    hotter *= 1.2;
    weights = SolveReps(returns, options.kl, hotter);
  }
  return weights;
}

class Search {
 public:
  Search(const Prior& prior, const RepsOptions& options) : options_(options), n_(prior.size()) {
    const Eigen::VectorXd zero = Eigen::VectorXd::Zero(n_), one = Eigen::VectorXd::Ones(n_);
    const Eigen::VectorXd width = (prior.FromStandard(one) - prior.FromStandard(-one)) / 2;
    prior_ = {prior.FromStandard(zero), width.array().square().matrix().asDiagonal()};
    run_.distribution = prior_;
  }

  Eigen::MatrixXd Draw(int update) const {
    Eigen::MatrixXd normals(n_, options_.samples);
    for (Eigen::Index i = 0; i < normals.cols(); ++i) {
      Random random(options_.seed,
                    {0x4e95, static_cast<uint32_t>(update), static_cast<uint32_t>(i)});
      for (Eigen::Index j = 0; j < n_; ++j) normals(j, i) = random.Normal();
    }
    return Transform(run_.distribution, normals);
  }

  void Update(const Eigen::MatrixXd& samples, Eigen::VectorXd values) {
    const bool likelihood = options_.returns == RepsReturns::kLogLikelihood;
    const double worst = likelihood ? -kInfinity : kInfinity;
    run_.simulations += values.size();
    for (double& value : values) {
      if (std::isfinite(value)) continue;
      value = worst;
      ++run_.failures;
    }
    if ((values.array() == worst).all()) return;  // nothing has been learned
    Eigen::VectorXd returns = -values;
    if (options_.returns == RepsReturns::kUnitRange) returns = UnitRange(values);
    std::optional<Gaussian> target;
    if (likelihood) {
      for (Eigen::Index i = 0; i < values.size(); ++i)
        values(i) += LogDensity(prior_, samples.col(i));
      returns = values;
      for (Eigen::Index i = 0; i < values.size(); ++i)
        returns(i) -= LogDensity(run_.distribution, samples.col(i));
      if (options_.surrogate) {
        Remember(samples, values);
        target = QuadraticFit(points_, densities_, run_.distribution);
      }
    }
    const RepsWeights weights = Solve(returns, options_);
    if (!target) target = FitGaussian(samples, weights, run_.distribution);
    const Gaussian before = run_.distribution;
    if (options_.damping > 0) {
      const double ratio =
          (Precision(before) * target->covariance).trace() / static_cast<double>(n_);
      target->covariance = std::pow(ratio, 1 / options_.damping) * before.covariance;
    }
    run_.distribution =
        options_.bound_distribution ? LimitKl(before, *target, options_.kl) : *target;
    run_.kl += KlDivergence(run_.distribution, before);
    run_.samples = samples, run_.weights = weights.weights;
    run_.temperature = weights.temperature, run_.ess = weights.ess;
  }

  RepsRun Take() { return std::move(run_); }

 private:
  void Remember(const Eigen::MatrixXd& samples, const Eigen::VectorXd& values) {
    const Eigen::Index before = points_.cols();
    points_.conservativeResize(n_, before + samples.cols());
    points_.rightCols(samples.cols()) = samples;
    densities_.conservativeResize(before + values.size());
    densities_.tail(values.size()) = values;
  }

  const RepsOptions& options_;
  Eigen::Index n_;
  Gaussian prior_;
  RepsRun run_;
  Eigen::MatrixXd points_{0, 0};
  Eigen::VectorXd densities_{0};
};

}  // namespace

RepsRun RepsSearch(const Prior& prior,
                   const std::function<Eigen::VectorXd(const Eigen::MatrixXd&)>& evaluate,
                   const RepsOptions& options, const std::function<void(int)>& progress) {
  Search search(prior, options);
  for (int update = 0; update < options.updates; ++update) {
    const Eigen::MatrixXd samples = search.Draw(update);
    search.Update(samples, evaluate(samples));
    progress(update + 1);
  }
  return search.Take();
}

}  // namespace plumb
