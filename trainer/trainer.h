#pragma once

#include <cstdint>
#include <string>

#include "controller/policy.h"
#include "robot/description.h"
#include "trainer/critic.h"
#include "trainer/rollout.h"
#include "trainer/trpo.h"
#include "trainer/workers.h"

namespace plumb {

/// All that training has learnt: what a checkpoint keeps.
struct TrainerState {
  GaussianPolicy policy;
  CriticState critic;
  int64_t updates = 0;           ///< since the beginning
  int64_t steps = 0;             ///< simulated steps since the beginning
  int64_t dropped_episodes = 0;  ///< since the beginning
};

/// One update in numbers.
struct UpdateReport {
  Trpo::Step step;
  int batch = 0;  ///< steps it rests on
  int dropped_episodes = 0;
  double mean_return = 0;         ///< of the batch's episodes, undiscounted
  double explained_variance = 0;  ///< of the critic, before it was fitted to this batch
  double entropy = 0;             ///< of the policy after the update [nat]
  bool critic_fitted = false;     ///< false: the fit was not finite and has been undone
};

/// Trains a policy in simulation: roll out, estimate advantages, step the policy, fit the critic. Its random
/// numbers are named by (seed, update, episode): the same bits for any number of threads and ranks, and for a
/// run that was interrupted and resumed. Not thread-safe itself.
class Trainer {
 public:
  /// @param make makes simulations; called once per thread. @param action_scale effort of action 1, per
  /// action.
  /// @param threads 0 = as many as the machine has.
  /// @param ranks must outlive this. All of them make the same trainer and call the same methods.
  Trainer(const TrainingSettings& settings, const SimulationFactory& make,
          const Eigen::VectorXd& action_scale, uint64_t seed, int threads,
          const Ranks& ranks = Ranks::Alone());

  TrainerState state() const;
  /// @throws std::invalid_argument if it is another network's.
  void Restore(TrainerState state);
  const GaussianPolicy& policy() const { return policy_; }
  int64_t updates() const { return updates_; }
  int64_t steps() const { return steps_; }

  /// One update of policy and critic. @throws std::runtime_error if the simulations cannot be used.
  UpdateReport Update(const ParameterSampler& sample);
  /// Mean return of the policy without exploration, on simulators drawn anew. Changes nothing.
  double Evaluate(const ParameterSampler& sample, int episodes);

 private:
  TrainingSettings settings_;
  uint64_t seed_;
  Workers workers_;
  GaussianPolicy policy_;
  Rollout rollout_;
  Trpo trpo_;
  Critic critic_;
  int64_t updates_ = 0;
  int64_t steps_ = 0;
  int64_t dropped_episodes_ = 0;
};

}  // namespace plumb
