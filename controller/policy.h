#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/random.h"
#include "plumb/policy_t.hpp"

namespace plumb {

/// Sizes of a multilayer perceptron with tanh hidden layers and a linear output.
struct PolicyShape {
  int observations = 0;
  std::vector<int> hidden;
  int actions = 0;

  bool operator==(const PolicyShape&) const = default;
  /// observations, hidden..., actions.
  std::vector<int> sizes() const;
  /// Weights and biases of the network, and one ln sd per action.
  int parameter_count() const;
};

/// A Gaussian policy: action = MLP((observation - mean) / scale) + exp(log_std) * noise, in policy
/// units, where 1 is action_scale newton metres (or newtons) and what lies beyond [-1, 1] is
/// clipped where it becomes an effort.
///
/// The parameters are one flat vector: for each layer W (out x in, column-major) then b (out); at
/// the very end log_std (actions). Trainer and controller share this layout and so does policy_t.
/// Const use is thread-safe.
class GaussianPolicy {
 public:
  /// All parameters zero, normaliser the identity, action_scale 1. @throws std::invalid_argument
  /// for a shape without observations or actions, with an empty layer, or absurdly large (see
  /// policy.cc).
  explicit GaussianPolicy(PolicyShape shape);

  /// A message's policy. @throws std::invalid_argument saying what is wrong: sizes that do not fit
  /// together or are absurd, numbers that are not finite, scales that are not positive, unknown
  /// purpose, negative counts.
  static GaussianPolicy FromMessage(const policy_t& message);
  /// The message, except for utime, iteration, trained_in, purpose, trial_steps and episodes (0),
  /// which are the sender's to fill in.
  policy_t ToMessage() const;

  const PolicyShape& shape() const { return shape_; }

  /// Mean action, `actions` values in policy units, not clipped.
  /// @param observation `observations` values as the task gives them. Not finite in, not finite
  /// out.
  Eigen::VectorXf Mean(const Eigen::Ref<const Eigen::VectorXf>& observation) const;
  /// A random action, not clipped.
  Eigen::VectorXf Sample(const Eigen::Ref<const Eigen::VectorXf>& observation,
                         Random& random) const;
  /// The network's input: (observation - mean) / scale, clipped to +-kObservationClip.
  Eigen::VectorXf Normalize(const Eigen::Ref<const Eigen::VectorXf>& observation) const;

  static constexpr float kObservationClip = 10;

  /// ln sd of the actions: the tail of `parameters`.
  Eigen::Ref<const Eigen::VectorXf> log_std() const { return parameters.tail(shape_.actions); }

  Eigen::VectorXf parameters;         ///< shape().parameter_count(); keep its size
  Eigen::VectorXf observation_mean;   ///< observations
  Eigen::VectorXf observation_scale;  ///< observations, > 0
  Eigen::VectorXf action_scale;       ///< actions, > 0: effort [Nm] or [N] of action 1

 private:
  PolicyShape shape_;
};

}  // namespace plumb
