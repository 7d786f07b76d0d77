#include "trainer/trpo.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "trainer/conjugate_gradient.h"

namespace plumb {
namespace {

constexpr double kCgTolerance = 1e-10;
constexpr int kLineSearchTries = 10;
constexpr double kLineSearchFactor = 0.8;

int Count(const PolicySamples& samples) { return static_cast<int>(samples.advantages.size()); }

}  // namespace

Trpo::Trpo(const TrainingSettings& settings, const PolicyShape& shape, Workers& workers,
           const Ranks& ranks)
    : settings_(settings),
      shape_(shape),
      network_(shape.sizes(), workers, ranks),
      fisher_network_(shape.sizes(), workers, ranks) {}

Eigen::VectorXf Trpo::SurrogateGradient(const GaussianPolicy& policy, const PolicySamples& samples,
                                        std::vector<float>& means) {
  const int actions = shape_.actions, count = Count(samples);
  const Eigen::ArrayXf precision = (-2 * policy.log_std().array()).exp();
  means.resize(samples.actions.size());
  Eigen::VectorXf gradient(shape_.parameter_count());
  Eigen::VectorXd log_std_gradient(actions);
  network_.Set(policy.parameters);
  // ln p(a) = -((a - mu) / sd)^2 / 2 - log_std + const: d/dmu = (a - mu) / sd^2, d/dlog_std = ((a -
  // mu) / sd)^2 - 1.
  network_.Gradient(
      samples.observations.data(), count,
      [&](int first, int columns, const float* outputs, float* output_gradient,
          std::span<double> sums) {
        for (int i = 0; i < columns; ++i) {
          const ptrdiff_t sample = ptrdiff_t{first} + i;
          const double weight = samples.advantages[static_cast<size_t>(sample)] / count;
          for (int a = 0; a < actions; ++a) {
            const auto at = static_cast<size_t>(sample * actions + a);
            means[at] = outputs[i * actions + a];
            const float offset = samples.actions[at] - means[at];
            output_gradient[i * actions + a] = static_cast<float>(weight) * offset * precision[a];
            sums[static_cast<size_t>(a)] += weight * (double{offset * offset * precision[a]} - 1);
          }
        }
      },
      gradient.head(network_.parameter_count()),
      {log_std_gradient.data(), static_cast<size_t>(actions)});
  gradient.tail(actions) = log_std_gradient.cast<float>();
  return gradient;
}

void Trpo::PrepareFisher(const GaussianPolicy& policy, const PolicySamples& samples) {
  const int stride = std::max(1, static_cast<int>(std::lround(1 / settings_.fisher_fraction)));
  fisher_inputs_.clear();
  for (int i = 0; i < Count(samples); i += stride) {
    const auto begin = samples.observations.begin() + ptrdiff_t{i} * shape_.observations;
    fisher_inputs_.insert(fisher_inputs_.end(), begin, begin + shape_.observations);
  }
  const int count = static_cast<int>(fisher_inputs_.size()) / shape_.observations;
  fisher_network_.Set(policy.parameters);
  fisher_network_.Linearize(fisher_inputs_.data(), count);
  fisher_metric_ = (-2 * policy.log_std().array()).exp() / static_cast<float>(count);
}

Eigen::VectorXf Trpo::FisherProduct(const Eigen::Ref<const Eigen::VectorXf>& v) {
  Eigen::VectorXf product(v.size());
  const Eigen::Index weights = v.size() - shape_.actions;
  fisher_network_.GaussNewtonProduct(v.head(weights), fisher_metric_, product.head(weights));
  product.tail(shape_.actions) = 2 * v.tail(shape_.actions);
  return product;
}

Trpo::Comparison Trpo::Compare(const GaussianPolicy& before, std::span<const float> means,
                               const GaussianPolicy& after, const PolicySamples& samples) {
  const int actions = shape_.actions, count = Count(samples);
  const Eigen::ArrayXd log_std = before.log_std().cast<double>(),
                       new_log_std = after.log_std().cast<double>();
  const Eigen::ArrayXd precision = (-2 * log_std).exp(), new_precision = (-2 * new_log_std).exp();
  // KL of two Gaussians: ln(s'/s) + (s^2 + (mu - mu')^2) / (2 s'^2) - 1/2; the part that is the
  // same for all samples:
  const double spread =
      (new_log_std - log_std + (2 * (log_std - new_log_std)).exp() / 2 - .5).sum();
  std::array<double, 2> sums;  // KL and gain
  network_.Set(after.parameters);
  network_.Sum(
      samples.observations.data(), count,
      [&](int first, int columns, const float* outputs, std::span<double> group_sums) {
        for (int i = 0; i < columns; ++i) {
          const ptrdiff_t sample = ptrdiff_t{first} + i;
          double log_ratio = (log_std - new_log_std).sum();
          for (int a = 0; a < actions; ++a) {
            const auto at = static_cast<size_t>(sample * actions + a);
            const double new_mean = outputs[i * actions + a];
            const double offset = double{samples.actions[at]} - means[at];
            const double new_offset = double{samples.actions[at]} - new_mean;
            const double moved = new_mean - means[at];
            log_ratio +=
                (offset * offset * precision[a] - new_offset * new_offset * new_precision[a]) / 2;
            group_sums[0] += moved * moved * new_precision[a] / 2;
          }
          group_sums[1] += std::expm1(log_ratio) * samples.advantages[static_cast<size_t>(sample)];
        }
      },
      sums);
  return {spread + sums[0] / count, sums[1] / count};
}

Trpo::Step Trpo::Improve(GaussianPolicy& policy, const PolicySamples& samples) {
  Step step;
  std::vector<float> means;
  const Eigen::VectorXd gradient = SurrogateGradient(policy, samples, means).cast<double>();
  PrepareFisher(policy, samples);
  const LinearSolution natural = ConjugateGradient(
      [&](const Eigen::VectorXd& v, Eigen::VectorXd& fv) {
        fv = FisherProduct(v.cast<float>()).cast<double>() + settings_.damping * v;
      },
      gradient, settings_.cg_iterations, kCgTolerance);
  if (!natural.failure.empty()) {
    step.failure = "conjugate gradient: " + natural.failure;
    return step;
  }
  // x'Ax = x'(b - r) costs no further product.
  const double curvature = natural.x.dot(gradient - natural.residual);
  if (!(curvature > 0) || !std::isfinite(curvature)) {
    step.failure = "no direction of improvement";
    return step;
  }
  const Eigen::VectorXd full_step = std::sqrt(2 * settings_.kl / curvature) * natural.x;

  const GaussianPolicy before = policy;
  double fraction = 1;
  while (step.tries < kLineSearchTries) {
    ++step.tries;
    policy.parameters = before.parameters + (fraction * full_step).cast<float>();
    policy.parameters.tail(shape_.actions) =
        policy.parameters.tail(shape_.actions).cwiseMax(kMinLogStd);
    const Comparison comparison = Compare(before, means, policy, samples);
    // Written so that NaN is refused.
    if (comparison.kl <= settings_.kl && comparison.gain > 0 && std::isfinite(comparison.gain)) {
      step.accepted = true;
      step.kl = comparison.kl;
      step.surrogate_gain = comparison.gain;
      return step;
    }
    fraction *= kLineSearchFactor;
  }
  policy.parameters = before.parameters;
  step.failure =
      fmt::format("line search: no improvement within the trust region in {} tries", step.tries);
  return step;
}

double Entropy(const GaussianPolicy& policy) {
  return policy.log_std().cast<double>().sum() +
         policy.shape().actions * .5 * std::log(2 * M_PI * std::exp(1.));
}

}  // namespace plumb
