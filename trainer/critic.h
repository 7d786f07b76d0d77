#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "common/random.h"
#include "robot/description.h"
#include "trainer/batch_network.h"
#include "trainer/moments.h"

namespace plumb {

/// All that a critic has learnt, as a checkpoint keeps it.
struct CriticState {
  Eigen::VectorXf parameters, first_moment, second_moment;  ///< of the network, and Adam's
  int32_t adam_steps = 0;
  /// of all value targets seen, the unit of the network's output; none: units of return
  RunningMoments targets;
};

/// The value function: a tanh network fitted to value targets by Adam. With normalise_values the
/// network predicts targets normalised by their running mean and standard deviation; when these
/// move, its output layer is rescaled so that the predicted values stay (van Hasselt et al., 2016,
/// "Pop-Art"). Minibatches are shared by threads or, where every rank has but one, by the ranks of
/// a machine; over a network it would take as long to exchange a gradient as to make it. Not
/// thread-safe.
class Critic {
 public:
  /// @param observations length of an input. @param random for the initial weights. @param
  /// workers,ranks must outlive it. All ranks make the same critic and call the same methods.
  Critic(const TrainingSettings& settings, int observations, Random random, Workers& workers,
         const Ranks& ranks = Ranks::Alone());

  const CriticState& state() const { return state_; }
  /// @throws std::invalid_argument if the sizes are another network's.
  void Restore(CriticState state);

  /// V of each observation. @param observations inputs x count, column-major.
  std::vector<double> Values(std::span<const float> observations);

  /// critic_epochs passes over the samples in random order, in minibatches; l2 * |parameters|^2 is
  /// added to the mean squared error (in units of return). If the result is not finite, the old
  /// state is kept.
  /// @return false in that case.
  bool Fit(std::span<const float> observations, std::span<const double> targets, Random& random);

 private:
  /// A part of a minibatch.
  struct Share {
    kernels::Tape tape;
    std::vector<float> inputs, outputs, output_gradient;
  };
  /// The network as one thread has it.
  struct Copy {
    kernels::Network network;
    int32_t adam_steps = -1;  ///< whose parameters these are
  };

  void Rescale(std::span<const double> targets);
  void Descend(std::span<const float> observations, std::span<const float> targets,
               std::span<const int> samples, float l2);

  TrainingSettings settings_;
  int observations_;
  Workers* workers_;
  BatchNetwork network_;
  CriticState state_;
  std::vector<Share> shares_;
  Eigen::MatrixXf gradients_;  // parameters x shares
  std::vector<Copy> copies_;   // one per worker
  Ranks neighbours_;           // on this machine
  std::vector<int> bounds_;    // neighbour r has the shares from [r] to [r + 1]
};

/// 1 - var(target - value) / var(target); 0 if the targets do not vary.
double ExplainedVariance(std::span<const double> values, std::span<const double> targets);

}  // namespace plumb
