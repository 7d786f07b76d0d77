#include "dashboard/posterior_json.h"

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "common/gaussian.h"

namespace plumb {
namespace {

using nlohmann::ordered_json;

constexpr std::array kProbabilities{.025, .25, .5, .75, .975};
// Where the data tell as much as the prior: Identifiability calls less of a parameter weak.
constexpr double kDetermined = std::numbers::sqrt2 / 2;

/// Of a mixture's coordinate.
double Probability(const GaussianMixture& mixture, Eigen::Index i, double below) {
  double probability = 0;
  for (size_t k = 0; k < mixture.weights.size(); ++k) {
    const Gaussian& component = mixture.components[k];
    const double sd = std::sqrt(component.covariance(i, i));
    const double distance = below - component.mean(i);
    const double part = sd > 0 ? NormalCdf(distance / sd) : distance >= 0;
    probability += mixture.weights[k] * part;
  }
  return probability;
}

/// By halving the interval in which it must be.
double Quantile(const GaussianMixture& mixture, const Gaussian& moments, Eigen::Index i,
                double probability) {
  const double reach = 10 * std::sqrt(moments.covariance(i, i));
  double low = moments.mean(i) - reach, high = moments.mean(i) + reach;
  for (int halvings = 0; halvings < 60; ++halvings) {
    const double middle = (low + high) / 2;
    (Probability(mixture, i, middle) < probability ? low : high) = middle;
  }
  return (low + high) / 2;
}

ordered_json Draws(const ParameterDistribution& distribution) {
  Random random(1);
  ordered_json draws = ordered_json::array();
  for (int draw = 0; draw < kPosteriorDraws; ++draw) {
    const Eigen::VectorXd values = distribution.Sample(random);
    draws.push_back(std::vector<double>(values.begin(), values.end()));
  }
  return draws;
}

}  // namespace

std::string PosteriorJson(const ParameterDistribution& distribution,
                          const ParameterDistribution& prior, int64_t utime) {
  const Gaussian moments = Moments(distribution.mixture), before = Moments(prior.mixture);
  const Eigen::VectorXd mean = distribution.Mean(), sd = distribution.Sd();
  const Eigen::VectorXd prior_mean = prior.Mean(), prior_sd = prior.Sd();
  ordered_json parameters = ordered_json::array();
  for (Eigen::Index i = 0; i < mean.size(); ++i) {
    const ParameterDescription& parameter = distribution.parameters[static_cast<size_t>(i)];
    ordered_json quantiles = ordered_json::array();
    for (const double p : kProbabilities)
      quantiles.push_back(parameter.ToPhysical(Quantile(distribution.mixture, moments, i, p)));
    const bool determined =
        std::sqrt(moments.covariance(i, i)) < kDetermined * std::sqrt(before.covariance(i, i));
    parameters.push_back({{"name", parameter.name},
                          {"unit", parameter.unit},
                          {"mean", mean(i)},
                          {"sd", sd(i)},
                          {"quantiles", quantiles},
                          {"prior_mean", prior_mean(i)},
                          {"prior_sd", prior_sd(i)},
                          {"determined", determined}});
  }
  const ordered_json posterior{{"utime", utime},
                               {"iteration", distribution.iteration},
                               {"parameters", parameters},
                               {"samples", Draws(distribution)},
                               {"prior_samples", Draws(prior)}};
  return posterior.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
}

}  // namespace plumb
