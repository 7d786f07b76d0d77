#include "trainer/critic.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "trainer/initialization.h"

namespace plumb {
namespace {

std::vector<int> Sizes(const TrainingSettings& settings, int observations) {
  std::vector<int> sizes{observations};
  sizes.insert(sizes.end(), settings.hidden.begin(), settings.hidden.end());
  sizes.push_back(1);
  return sizes;
}

void Shuffle(std::vector<int>& order, Random& random) {
  for (size_t i = order.size(); i > 1; --i) {
    std::swap(order[i - 1], order[static_cast<size_t>(random.Uniform() * static_cast<double>(i))]);
  }
}

}  // namespace

void RunningMoments::Add(double value) {
  count += 1;
  const double offset = value - mean;
  mean += offset / count;
  squares += offset * (value - mean);
}

double RunningMoments::sd() const { return squares > 0 ? std::sqrt(squares / count) : 1; }

Critic::Critic(const TrainingSettings& settings, int observations, Random random, Workers& workers,
               const Ranks& ranks)
    : settings_(settings),
      observations_(observations),
      network_(Sizes(settings, observations), workers, ranks) {
  state_.parameters = OrthogonalParameters(Sizes(settings, observations), 1, random);
  state_.first_moment.setZero(state_.parameters.size());
  state_.second_moment.setZero(state_.parameters.size());
}

void Critic::Restore(CriticState state) {
  const Eigen::Index count = network_.parameter_count();
  if (state.parameters.size() != count || state.first_moment.size() != count ||
      state.second_moment.size() != count) {
    throw std::invalid_argument("critic: state of another network");
  }
  state_ = std::move(state);
}

std::vector<double> Critic::Values(std::span<const float> observations) {
  const size_t count = observations.size() / static_cast<size_t>(observations_);
  std::vector<float> outputs(count);
  network_.Set(state_.parameters);
  network_.Forward(observations.data(), static_cast<int>(count), outputs.data());
  std::vector<double> values(count);
  const double mean = state_.targets.mean, sd = state_.targets.sd();
  std::transform(outputs.begin(), outputs.end(), values.begin(), [&](float y) { return mean + sd * y; });
  return values;
}

void Critic::Rescale(std::span<const double> targets) {
  const bool first = state_.targets.count == 0;
  const double old_mean = state_.targets.mean, old_sd = state_.targets.sd();
  for (const double target : targets) state_.targets.Add(target);
  const double mean = state_.targets.mean, sd = state_.targets.sd();
  if (first) return;  // a fresh network's values are nothing worth keeping
  // The output layer is the tail: one weight per unit below it, then the bias.
  auto output =
      state_.parameters.tail(settings_.hidden.empty() ? observations_ + 1 : settings_.hidden.back() + 1);
  output *= static_cast<float>(old_sd / sd);
  state_.parameters.tail(1).array() += static_cast<float>((old_mean - mean) / sd);
}

bool Critic::Fit(std::span<const float> observations, std::span<const double> targets, Random& random) {
  const CriticState before = state_;
  Rescale(targets);
  const double mean = state_.targets.mean, sd = state_.targets.sd();
  // Twice, as the gradient of the square; per sd^2, since the error is in that unit.
  const auto l2 = static_cast<float>(2 * settings_.critic_l2 / (sd * sd));

  const int count = static_cast<int>(targets.size());
  std::vector<int> order(targets.size());
  std::iota(order.begin(), order.end(), 0);
  std::vector<float> inputs, normalised;
  Eigen::VectorXf gradient(state_.parameters.size());
  for (int epoch = 0; epoch < settings_.critic_epochs; ++epoch) {
    Shuffle(order, random);
    for (int first = 0; first < count; first += settings_.critic_minibatch) {
      const int size = std::min(settings_.critic_minibatch, count - first);
      inputs.clear();
      normalised.clear();
      for (int i = first; i < first + size; ++i) {
        const int sample = order[static_cast<size_t>(i)];
        const auto begin = observations.begin() + ptrdiff_t{sample} * observations_;
        inputs.insert(inputs.end(), begin, begin + observations_);
        normalised.push_back(static_cast<float>((targets[static_cast<size_t>(sample)] - mean) / sd));
      }
      network_.Set(state_.parameters);
      network_.Gradient(
          inputs.data(), size,
          [&](int group, int columns, const float* outputs, float* output_gradient, std::span<double>) {
            for (int i = 0; i < columns; ++i) {
              const float error = outputs[i] - normalised[static_cast<size_t>(group + i)];
              output_gradient[i] = 2 * error / static_cast<float>(size);
            }
          },
          gradient);
      kernels::AdamStep(static_cast<int>(gradient.size()), ++state_.adam_steps,
                        static_cast<float>(settings_.critic_rate), l2, gradient.data(),
                        state_.parameters.data(), state_.first_moment.data(), state_.second_moment.data());
    }
  }
  if (state_.parameters.allFinite() && state_.second_moment.allFinite()) return true;
  state_ = before;
  return false;
}

double ExplainedVariance(std::span<const double> values, std::span<const double> targets) {
  RunningMoments error, target;
  for (size_t i = 0; i < targets.size(); ++i) {
    error.Add(targets[i] - values[i]);
    target.Add(targets[i]);
  }
  return target.squares > 0 ? 1 - error.squares / target.squares : 0;
}

}  // namespace plumb
