#include "robot/settings/training.h"

#include "robot/settings/ranges.h"

namespace plumb {
namespace {

constexpr Range kUpdates{1, 1e7};  // of each of up to 100 starts

}  // namespace

TrainingSettings ReadTraining(Config config) {
  TrainingSettings s;
  s.batch = config.Integer("batch", {10, 1e7});
  s.updates = config.Integer("updates", kUpdates);
  s.updates_again = config.Integer("updates_again", {0, 1e9});
  s.starts = config.Integer("starts", {1, 100}, 1);
  s.trial = config.Number("trial", {0, 0.9}, 0.5);
  s.hidden = config.Integers("hidden", {1, 4096});
  s.initial_sd = config.Number("initial_sd", {1e-3, 10}, 1);
  s.gamma = config.Number("gamma", {0, 1});
  s.lambda = config.Number("lambda", {0, 1});
  s.kl = config.Number("kl", kSanePositive);
  s.damping = config.Number("damping", kSaneNotNegative);
  s.cg_iterations = config.Integer("cg_iterations", {1, 1000});
  s.fisher_fraction = config.Number("fisher_fraction", {1e-3, 1});
  s.critic_l2 = config.Number("critic_l2", kSaneNotNegative);
  s.critic_rate = config.Number("critic_rate", kSanePositive);
  s.critic_epochs = config.Integer("critic_epochs", {1, 10000});
  s.critic_minibatch = config.Integer("critic_minibatch", {1, 1e7});
  s.normalise_values = config.Boolean("normalise_values", true);
  s.normalise_observations = config.Boolean("normalise_observations", false);
  s.worst_share = config.Number("worst_share", {0.01, 1}, 1);
  s.worst_after = config.Integer("worst_after", {0, 1e9}, 100);
  s.duration = config.Number("duration", {0, 1e6}, 0);
  s.position_noise = config.Number("position_noise", kSaneNotNegative, 0);
  s.velocity_noise = config.Number("velocity_noise", kSaneNotNegative, 0);
  config.Finish();
  return s;
}

}  // namespace plumb
