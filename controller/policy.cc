#include "controller/policy.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

namespace plumb {
namespace {

// Far beyond any use, and small enough that a hostile message cannot ask for much.
constexpr int kMaxLayers = 10;
constexpr int kMaxWidth = 4096;
constexpr int64_t kMaxParameters = 1 << 24;
constexpr int kMaxEpisodes = 10'000;  // each CONTROLLER_STATUS lists all: 45 bytes each

[[noreturn]] void Reject(const std::string& what) {
  throw std::invalid_argument("policy: " + what);
}

int64_t CountParameters(const std::vector<int>& sizes) {
  int64_t count = sizes.back();
  for (size_t i = 1; i < sizes.size(); ++i) count += (int64_t{sizes[i - 1]} + 1) * sizes[i];
  return count;
}

void RequireSane(const std::vector<int>& sizes) {
  if (sizes.size() < 2 || sizes.size() > kMaxLayers) Reject(fmt::format("{} layers", sizes.size()));
  for (const int size : sizes) {
    if (size < 1 || size > kMaxWidth) Reject(fmt::format("a layer of {}", size));
  }
  if (const int64_t count = CountParameters(sizes); count > kMaxParameters) {
    Reject(fmt::format("{} parameters", count));
  }
}

Eigen::VectorXf Take(const char* what, const std::vector<float>& values, int64_t announced,
                     int64_t expected) {
  if (announced != expected || values.size() != static_cast<size_t>(expected)) {
    Reject(fmt::format("{} {}, expected {}", announced, what, expected));
  }
  Eigen::VectorXf result = Eigen::Map<const Eigen::VectorXf>(values.data(), expected);
  if (!result.allFinite()) Reject(fmt::format("{} are not finite", what));
  return result;
}

Eigen::VectorXf TakePositive(const char* what, const std::vector<float>& values, int64_t announced,
                             int64_t expected) {
  Eigen::VectorXf result = Take(what, values, announced, expected);
  // A denormal scale would make infinities of ordinary observations.
  if ((result.array() < std::numeric_limits<float>::min()).any())
    Reject(fmt::format("{} are not positive", what));
  return result;
}

std::vector<float> ToVector(const Eigen::VectorXf& values) {
  return {values.begin(), values.end()};
}

}  // namespace

std::vector<int> PolicyShape::sizes() const {
  std::vector<int> sizes{observations};
  sizes.insert(sizes.end(), hidden.begin(), hidden.end());
  sizes.push_back(actions);
  return sizes;
}

int PolicyShape::parameter_count() const { return static_cast<int>(CountParameters(sizes())); }

GaussianPolicy::GaussianPolicy(PolicyShape shape) : shape_(std::move(shape)) {
  RequireSane(shape_.sizes());
  parameters.setZero(shape_.parameter_count());
  observation_mean.setZero(shape_.observations);
  observation_scale.setOnes(shape_.observations);
  action_scale.setOnes(shape_.actions);
}

GaussianPolicy GaussianPolicy::FromMessage(const policy_t& message) {
  if (message.iteration < 0) Reject(fmt::format("iteration {}", message.iteration));
  if (message.purpose != policy_t::CALIBRATE && message.purpose != policy_t::EVALUATE) {
    Reject(fmt::format("purpose {}", static_cast<int>(message.purpose)));
  }
  if (message.episodes < 0 || message.episodes > kMaxEpisodes)
    Reject(fmt::format("{} episodes", message.episodes));
  if (message.num_layers < 0 || message.size.size() != static_cast<size_t>(message.num_layers)) {
    Reject(fmt::format("{} layers, {} sizes", message.num_layers, message.size.size()));
  }
  const std::vector<int> sizes(message.size.begin(), message.size.end());
  RequireSane(sizes);
  GaussianPolicy policy({sizes.front(), {sizes.begin() + 1, sizes.end() - 1}, sizes.back()});
  const PolicyShape& shape = policy.shape_;
  policy.parameters = Take("weights", message.weight, message.num_weights, shape.parameter_count());
  policy.observation_mean = Take("observation means", message.observation_mean,
                                 message.num_observations, shape.observations);
  policy.observation_scale = TakePositive("observation scales", message.observation_scale,
                                          message.num_observations, shape.observations);
  policy.action_scale =
      TakePositive("action scales", message.action_scale, message.num_actions, shape.actions);
  return policy;
}

policy_t GaussianPolicy::ToMessage() const {
  policy_t message;
  message.utime = 0;
  message.iteration = message.trained_in = 0;
  message.purpose = policy_t::CALIBRATE;
  message.episodes = 0;
  message.trial_steps = 0;
  const std::vector<int> sizes = shape_.sizes();
  message.num_layers = static_cast<int32_t>(sizes.size());
  message.size.assign(sizes.begin(), sizes.end());
  message.num_weights = static_cast<int32_t>(parameters.size());
  message.weight = ToVector(parameters);
  message.num_observations = shape_.observations;
  message.observation_mean = ToVector(observation_mean);
  message.observation_scale = ToVector(observation_scale);
  message.num_actions = shape_.actions;
  message.action_scale = ToVector(action_scale);
  return message;
}

Eigen::VectorXf GaussianPolicy::Normalize(
    const Eigen::Ref<const Eigen::VectorXf>& observation) const {
  const auto normalised = (observation - observation_mean).array() / observation_scale.array();
  // This order of min and max lets NaN through, to be seen by whoever checks the action.
  return normalised.unaryExpr([](float x) {
    return x > kObservationClip ? kObservationClip : x < -kObservationClip ? -kObservationClip : x;
  });
}

Eigen::VectorXf GaussianPolicy::Mean(const Eigen::Ref<const Eigen::VectorXf>& observation) const {
  Eigen::VectorXf activation = Normalize(observation);
  const std::vector<int> sizes = shape_.sizes();
  const float* next = parameters.data();
  for (size_t layer = 1; layer < sizes.size(); ++layer) {
    const Eigen::Index in = sizes[layer - 1], out = sizes[layer];
    const Eigen::Map<const Eigen::MatrixXf> weight(next, out, in);
    const Eigen::Map<const Eigen::VectorXf> bias(next + out * in, out);
    next += out * in + out;
    Eigen::VectorXf sum = bias;
    sum.noalias() += weight * activation;
    activation = layer + 1 < sizes.size() ? Eigen::VectorXf(sum.array().tanh()) : std::move(sum);
  }
  return activation;
}

Eigen::VectorXf GaussianPolicy::Sample(const Eigen::Ref<const Eigen::VectorXf>& observation,
                                       Random& random) const {
  Eigen::VectorXf action = Mean(observation);
  for (Eigen::Index i = 0; i < action.size(); ++i) {
    action[i] += std::exp(log_std()[i]) * static_cast<float>(random.Normal());
  }
  return action;
}

}  // namespace plumb
