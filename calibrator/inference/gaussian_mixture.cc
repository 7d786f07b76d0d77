#include "calibrator/inference/gaussian_mixture.h"

#include <cmath>
#include <limits>
#include <stdexcept>

#include "common/decompositions.h"
#include "common/special_numbers.h"

namespace plumb {
namespace {

// ln N(x; p) of every column.
Eigen::VectorXd LogDensitiesOf(const Gaussian& p, const Eigen::MatrixXd& points) {
  const Eigen::LLT<Eigen::MatrixXd> factor(p.covariance);
  if (factor.info() != Eigen::Success)
    throw std::invalid_argument("covariance is not positive definite");
  const Eigen::Index n = p.mean.size();
  const double log_normaliser = factor.matrixLLT().diagonal().array().log().sum() +
                                0.5 * static_cast<double>(n) * std::log(2 * M_PI);
  const Eigen::MatrixXd inverse_root = factor.matrixL().solve(Eigen::MatrixXd::Identity(n, n));
  const Eigen::MatrixXd whitened = inverse_root * (points.colwise() - p.mean);
  return -0.5 * whitened.colwise().squaredNorm().transpose().array() - log_normaliser;
}

// Index of a column drawn in proportion to the entries >= 0 of `weights`.
Eigen::Index Draw(const Eigen::ArrayXd& weights, Random& random) {
  double left = random.Uniform() * weights.sum();
  Eigen::Index i = 0;
  while (i + 1 < weights.size() && left >= weights(i)) left -= weights(i++);
  return i;
}

// k-means++ and Lloyd's steps in coordinates scaled to unit variance; N x K memberships, 0 or 1.
Eigen::MatrixXd Cluster(const Eigen::MatrixXd& scaled, const Eigen::VectorXd& weights, int clusters,
                        Random& random) {
  constexpr int kLloydSteps = 5;
  const Eigen::Index count = scaled.cols();
  Eigen::MatrixXd centres(scaled.rows(), clusters);
  Eigen::ArrayXd nearest = Eigen::ArrayXd::Constant(count, kInfinity);
  for (int k = 0; k < clusters; ++k) {
    centres.col(k) =
        scaled.col(Draw(k == 0 ? Eigen::ArrayXd(weights) : weights.array() * nearest, random));
    nearest = nearest.min(
        (scaled.colwise() - centres.col(k)).colwise().squaredNorm().transpose().array());
  }
  Eigen::MatrixXd members;
  for (int step = 0; step <= kLloydSteps; ++step) {
    Eigen::MatrixXd distances(count, clusters);
    for (int k = 0; k < clusters; ++k) {
      distances.col(k) = (scaled.colwise() - centres.col(k)).colwise().squaredNorm().transpose();
    }
    members = Eigen::MatrixXd::Zero(count, clusters);
    for (Eigen::Index i = 0; i < count; ++i) {
      Eigen::Index k;
      distances.row(i).minCoeff(&k);
      members(i, k) = 1;
    }
    for (int k = 0; k < clusters; ++k) {
      const Eigen::VectorXd w = members.col(k).cwiseProduct(weights);
      if (w.sum() > 0) centres.col(k) = scaled * w / w.sum();
    }
  }
  return members;
}

// The M step. Weights sum to 1; the smallest share a component may live on is `least`.
GaussianMixture Maximise(const Eigen::MatrixXd& samples, const Eigen::VectorXd& weights,
                         const Eigen::MatrixXd& responsibilities, const Eigen::VectorXd& floor,
                         double least) {
  GaussianMixture mixture;
  double kept = 0;
  for (Eigen::Index k = 0; k < responsibilities.cols(); ++k) {
    const Eigen::VectorXd w = responsibilities.col(k).cwiseProduct(weights);
    const double share = w.sum();
    if (!(share > least)) continue;
    Gaussian component;
    component.mean = samples * w / share;
    const Eigen::MatrixXd centred = samples.colwise() - component.mean;
    component.covariance = centred * (w / share).asDiagonal() * centred.transpose();
    component.covariance.diagonal() += floor;
    mixture.weights.push_back(share);
    mixture.components.push_back(std::move(component));
    kept += share;
  }
  for (double& w : mixture.weights) w /= kept;
  return mixture;
}

}  // namespace

Eigen::MatrixXd ComponentLogDensities(const GaussianMixture& mixture,
                                      const Eigen::MatrixXd& points) {
  Eigen::MatrixXd result(points.cols(), static_cast<Eigen::Index>(mixture.components.size()));
  for (size_t k = 0; k < mixture.components.size(); ++k) {
    result.col(static_cast<Eigen::Index>(k)) =
        LogDensitiesOf(mixture.components[k], points).array() + std::log(mixture.weights[k]);
  }
  return result;
}

Eigen::VectorXd LogSumExp(const Eigen::MatrixXd& rows) {
  const Eigen::VectorXd top = rows.rowwise().maxCoeff();
  return top.array() + (rows.colwise() - top).array().exp().rowwise().sum().log();
}

Eigen::VectorXd LogDensities(const GaussianMixture& mixture, const Eigen::MatrixXd& points) {
  return LogSumExp(ComponentLogDensities(mixture, points));
}

double LogDensity(const GaussianMixture& mixture, const Eigen::VectorXd& x) {
  return LogDensities(mixture, x)(0);
}

Eigen::MatrixXd Sample(const GaussianMixture& mixture, Eigen::Index count, Random& random) {
  std::vector<Eigen::MatrixXd> roots;
  for (const Gaussian& component : mixture.components) {
    const Eigen::LLT<Eigen::MatrixXd> factor(component.covariance);
    if (factor.info() != Eigen::Success)
      throw std::invalid_argument("covariance is not positive definite");
    roots.emplace_back(factor.matrixL());
  }
  const Eigen::Map<const Eigen::ArrayXd> weights(mixture.weights.data(),
                                                 static_cast<Eigen::Index>(mixture.weights.size()));
  Eigen::MatrixXd draws(mixture.components.at(0).mean.size(), count);
  for (Eigen::Index j = 0; j < count; ++j) {
    const auto k = static_cast<size_t>(Draw(weights, random));
    draws.col(j) = roots[k] * StandardNormals(draws.rows(), 1, random) + mixture.components[k].mean;
  }
  return draws;
}

GaussianMixture Marginal(const GaussianMixture& mixture,
                         const std::vector<Eigen::Index>& coordinates) {
  GaussianMixture marginal{mixture.weights, {}};
  for (const Gaussian& c : mixture.components) {
    marginal.components.push_back({c.mean(coordinates), c.covariance(coordinates, coordinates)});
  }
  return marginal;
}

GaussianMixture Condition(const GaussianMixture& joint, const Eigen::VectorXd& y,
                          double negligible) {
  const Eigen::Index m = y.size(), n = joint.components.at(0).mean.size() - m;
  std::vector<double> log_weights;
  std::vector<Gaussian> conditionals;
  double largest = -kInfinity;
  for (size_t k = 0; k < joint.components.size(); ++k) {
    const Gaussian& c = joint.components[k];
    const Gaussian of_y{c.mean.tail(m), c.covariance.bottomRightCorner(m, m)};
    const Eigen::LLT<Eigen::MatrixXd> factor(of_y.covariance);
    const Eigen::MatrixXd gain = factor.solve(c.covariance.bottomLeftCorner(m, n)).transpose();
    Gaussian conditional{
        c.mean.head(n) + gain * (y - of_y.mean),
        c.covariance.topLeftCorner(n, n) - gain * c.covariance.bottomLeftCorner(m, n)};
    conditional.covariance =
        (conditional.covariance + conditional.covariance.transpose()).eval() / 2;
    conditionals.push_back(std::move(conditional));
    log_weights.push_back(std::log(joint.weights[k]) + LogDensity(of_y, y));
    largest = std::max(largest, log_weights.back());
  }
  GaussianMixture result;
  double sum = 0;
  for (size_t k = 0; k < conditionals.size(); ++k) {
    const double weight = std::exp(log_weights[k] - largest);
    if (!(weight >= negligible)) continue;
    result.weights.push_back(weight);
    result.components.push_back(std::move(conditionals[k]));
    sum += weight;
  }
  for (double& w : result.weights) w /= sum;
  return result;
}

MixtureFit FitMixture(const Eigen::MatrixXd& samples, const Eigen::VectorXd& weights,
                      int components, Random& random, const MixtureOptions& options) {
  const double sum = weights.sum();
  if (samples.cols() == 0 || samples.cols() != weights.size() || !(weights.minCoeff() >= 0) ||
      !(sum > 0) || !std::isfinite(sum) || !samples.allFinite() || components < 1) {
    throw std::invalid_argument(
        "a mixture is fitted to finite samples with weights >= 0 and has a component at least");
  }
  const Eigen::VectorXd w = weights / sum;
  const double effective = 1 / w.squaredNorm();
  const double n = static_cast<double>(samples.rows());
  const Eigen::VectorXd mean = samples * w;
  const Eigen::VectorXd variance = ((samples.colwise() - mean).array().square().matrix() * w)
                                       .cwiseMax(std::numeric_limits<double>::min());
  // A coordinate that never changes must leave the covariance invertible.
  const Eigen::VectorXd floor =
      (options.regularisation * variance).cwiseMax(1e-12 * std::max(variance.maxCoeff(), 1e-12));
  const Eigen::VectorXd scale = (variance + floor).cwiseSqrt();
  const double least = (n + 1) / effective;

  const Eigen::MatrixXd scaled = scale.cwiseInverse().asDiagonal() * (samples.colwise() - mean);
  Eigen::MatrixXd responsibilities = components == 1 ? Eigen::MatrixXd::Ones(samples.cols(), 1)
                                                     : Cluster(scaled, w, components, random);
  MixtureFit fit;
  fit.mixture = Maximise(samples, w, responsibilities, floor, components == 1 ? 0 : least);
  if (fit.mixture.components.empty()) {  // too few samples for any cluster
    return FitMixture(samples, weights, 1, random, options);
  }
  for (int iteration = 0;; ++iteration) {
    const Eigen::MatrixXd joint = ComponentLogDensities(fit.mixture, samples);
    const Eigen::VectorXd evidence = LogSumExp(joint);
    responsibilities = (joint.colwise() - evidence).array().exp();
    fit.log_likelihood.push_back(w.dot(evidence));
    const size_t steps = fit.log_likelihood.size();
    const bool converged =
        steps > 1 &&
        fit.log_likelihood[steps - 1] - fit.log_likelihood[steps - 2] < options.tolerance;
    if (converged || iteration == options.max_iterations || fit.mixture.components.size() == 1)
      break;
    GaussianMixture next = Maximise(samples, w, responsibilities, floor, least);
    if (next.components.empty()) break;
    fit.mixture = std::move(next);
  }
  const double k = static_cast<double>(fit.mixture.components.size());
  const double parameters = k * (1 + n + n * (n + 1) / 2) - 1;
  fit.bic = parameters * std::log(effective) - 2 * effective * fit.log_likelihood.back();
  return fit;
}

MixtureFit SelectMixture(const Eigen::MatrixXd& samples, const Eigen::VectorXd& weights,
                         int max_components, Random& random, const MixtureOptions& options) {
  MixtureFit best = FitMixture(samples, weights, 1, random, options);
  int failures = 0;
  for (int base = 2; base <= max_components && failures < 2; base *= 2) {
    for (const int components : {base, base + base / 2}) {
      if (components > max_components || failures == 2) continue;
      MixtureFit fit = FitMixture(samples, weights, components, random, options);
      failures = fit.bic < best.bic ? 0 : failures + 1;
      if (fit.bic < best.bic) best = std::move(fit);
    }
  }
  return best;
}

}  // namespace plumb
