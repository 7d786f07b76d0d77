#include "calibrator/inference/reps.h"

#include <boost/math/tools/roots.hpp>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "common/decompositions.h"

namespace plumb {
namespace {

// Weights at one temperature; `shifted` = R - max R.
RepsWeights AtTemperature(const Eigen::ArrayXd& shifted, double temperature) {
  RepsWeights result;
  // Eigen's vectorised exp(-infinity) is tiny, not zero.
  const Eigen::ArrayXd unnormalised = shifted.isFinite().select((shifted / temperature).exp(), 0.0);
  result.weights = unnormalised / unnormalised.sum();
  result.temperature = temperature;
  const Eigen::ArrayXd w = result.weights.array();
  const double entropy =
      -(w > 0).select(w * w.max(std::numeric_limits<double>::min()).log(), 0.0).sum();
  result.kl = std::log(static_cast<double>(w.size())) - entropy;
  result.ess = 1 / w.square().sum();
  return result;
}

}  // namespace

RepsWeights SolveReps(const Eigen::VectorXd& returns, double kl_bound, double min_temperature) {
  if (returns.size() == 0 || returns.array().isNaN().any() || !std::isfinite(returns.maxCoeff())) {
    throw std::invalid_argument("REPS needs returns that are not NaN, at least one of them finite");
  }
  const Eigen::ArrayXd shifted = returns.array() - returns.maxCoeff();
  RepsWeights sharpest = AtTemperature(shifted, min_temperature);
  // With ties among the best the bound may be out of reach; then the minimum temperature rules.
  if (sharpest.kl <= kl_bound) return sharpest;

  // KL falls from above the bound at the minimum temperature towards 0 as the temperature grows;
  // samples of return -infinity never get weight, so it may not fall below the bound at all.
  double lower = std::log(min_temperature), upper = lower;
  constexpr double kHottest = 700;
  do {
    upper = std::min(upper + 2, kHottest);
    if (AtTemperature(shifted, std::exp(upper)).kl <= kl_bound) break;
    lower = upper;
  } while (upper < kHottest);
  if (upper >= kHottest) return AtTemperature(shifted, std::exp(kHottest));
  const auto excess = [&](double log_temperature) {
    return AtTemperature(shifted, std::exp(log_temperature)).kl - kl_bound;
  };
  const auto bracket = boost::math::tools::bisect(excess, lower, upper,
                                                  boost::math::tools::eps_tolerance<double>(48));
  return AtTemperature(shifted, std::exp(bracket.second));  // the side within the bound
}

Gaussian FitGaussian(const Eigen::MatrixXd& samples, const RepsWeights& weights,
                     const Gaussian& prior) {
  Gaussian fit;
  fit.mean = samples * weights.weights;
  const Eigen::MatrixXd centred = samples.colwise() - fit.mean;
  const double bias = std::max(1 - weights.weights.squaredNorm(), 0.1);
  const Eigen::MatrixXd spread =
      centred * weights.weights.asDiagonal() * centred.transpose() / bias;
  const double n = static_cast<double>(samples.rows());
  fit.covariance = (weights.ess * spread + n * prior.covariance) / (weights.ess + n);
  return fit;
}

Gaussian LimitKl(const Gaussian& old, const Gaussian& target, double kl_bound) {
  if (KlDivergence(target, old) <= kl_bound) return target;
  const Eigen::Index n = old.mean.size();
  const auto identity = Eigen::MatrixXd::Identity(n, n);
  const Eigen::MatrixXd old_precision = Precision(old), target_precision = Precision(target);
  const auto between = [&](double a) {
    const Eigen::MatrixXd precision = a * target_precision + (1 - a) * old_precision;
    const Eigen::LLT<Eigen::MatrixXd> factor(precision);
    Gaussian p;
    p.mean =
        factor.solve(a * (target_precision * target.mean) + (1 - a) * (old_precision * old.mean));
    p.covariance = factor.solve(identity);
    p.covariance = (p.covariance + p.covariance.transpose()).eval() / 2;
    return p;
  };
  double inside = 0, outside = 1;
  for (int i = 0; i < 60; ++i) {
    const double middle = (inside + outside) / 2;
    (KlDivergence(between(middle), old) <= kl_bound ? inside : outside) = middle;
  }
  return between(inside);
}

}  // namespace plumb
