#pragma once

#include <vector>

#include "common/config.h"

namespace plumb {

/// [training]: of the trainer, see docs/training.md.
struct TrainingSettings {
  int batch, updates, updates_again;
  /// trainings from nothing in the first iteration, of `updates` each; the best policy goes on
  int starts = 1;
  /// of a roll-out's steps, the first so many try the policy, without exploration: what does worse
  /// on the robot is not deployed there. 0 = no trials, the newest policy is deployed
  double trial = 0.5;
  std::vector<int> hidden;
  double initial_sd = 1;  ///< of a fresh policy's actions, in policy units, > 0
  double gamma, lambda, kl, damping;
  int cg_iterations;
  double fisher_fraction;
  double critic_l2, critic_rate;
  int critic_epochs, critic_minibatch;
  bool normalise_values = true;         ///< the critic's targets, by their running mean and sd
  bool normalise_observations = false;  ///< by their running mean and sd
  /// of the episodes, by return, that an update learns from (EPOpt); 1 = all
  double worst_share = 1;
  int worst_after = 100;  ///< updates that learn from all of them
  /// [s] >= 0 that an iteration's training takes in virtual time
  double duration = 0;
  /// sd of what the policy is told [rad or m], [rad/s or m/s]
  double position_noise = 0, velocity_noise = 0;

  /// Of all starts.
  int first_updates() const { return starts * updates; }
};

/// Thread-safe. @throws ConfigError
TrainingSettings ReadTraining(Config config);

}  // namespace plumb
