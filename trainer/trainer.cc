#include "trainer/trainer.h"

#include <stdexcept>
#include <utility>
#include <vector>

#include "trainer/gae.h"
#include "trainer/initialization.h"

namespace plumb {
namespace {

/// Names of the trainer's streams of random numbers; the other words are the update and the episode.
enum Stream : uint32_t {
  kPolicyStream = 0x7472'0000,
  kCriticStream,
  kRolloutStream,
  kFitStream,
  kEvaluationStream
};

constexpr double kOutputGain = 0.01;  // of a fresh policy: every mean action is near 0

GaussianPolicy FreshPolicy(const TrainingSettings& settings, const SimulationFactory& make,
                           const Eigen::VectorXd& action_scale, uint64_t seed) {
  const std::unique_ptr<Simulation> simulation = make();
  GaussianPolicy policy({simulation->observation_size(), settings.hidden, simulation->action_size()});
  if (action_scale.size() != simulation->action_size())
    throw std::invalid_argument("trainer: size of action scale");
  policy.action_scale = action_scale.cast<float>();
  Random random(seed, {kPolicyStream});
  const Eigen::VectorXf weights = OrthogonalParameters(policy.shape().sizes(), kOutputGain, random);
  policy.parameters.head(weights.size()) = weights;
  return policy;
}

}  // namespace

Trainer::Trainer(const TrainingSettings& settings, const SimulationFactory& make,
                 const Eigen::VectorXd& action_scale, uint64_t seed, int threads, const Ranks& ranks)
    : settings_(settings),
      seed_(seed),
      workers_(threads),
      policy_(FreshPolicy(settings, make, action_scale, seed)),
      rollout_(make, policy_.shape(), workers_),
      trpo_(settings, policy_.shape(), workers_, ranks),
      critic_(settings, policy_.shape().observations, Random(seed, {kCriticStream}), workers_, ranks) {}

TrainerState Trainer::state() const {
  return {policy_, critic_.state(), updates_, steps_, dropped_episodes_};
}

void Trainer::Restore(TrainerState state) {
  if (state.policy.shape() != policy_.shape())
    throw std::invalid_argument("trainer: state of another network");
  critic_.Restore(std::move(state.critic));
  policy_ = std::move(state.policy);
  updates_ = state.updates;
  steps_ = state.steps;
  dropped_episodes_ = state.dropped_episodes;
}

UpdateReport Trainer::Update(const ParameterSampler& sample) {
  const auto update = static_cast<uint32_t>(updates_);
  const Batch batch = rollout_.Collect(policy_, sample, settings_.batch, seed_, kRolloutStream, update);
  const std::vector<double> values = critic_.Values(batch.observations);
  const std::vector<double> final_values = critic_.Values(batch.final_observations);
  std::vector<EpisodeSpan> episodes;
  for (const Batch::Episode& episode : batch.episodes) {
    episodes.push_back({episode.begin, episode.end, episode.terminated, final_values[episodes.size()]});
  }
  Advantages advantages =
      EstimateAdvantages(batch.rewards, values, episodes, settings_.gamma, settings_.lambda);
  Normalize(advantages.advantage);

  UpdateReport report;
  report.batch = batch.size();
  report.dropped_episodes = batch.dropped;
  report.mean_return = batch.MeanReturn();
  report.explained_variance = ExplainedVariance(values, advantages.target);
  report.step = trpo_.Improve(policy_, {batch.observations, batch.actions, advantages.advantage});
  Random random(seed_, {kFitStream, update});
  report.critic_fitted = critic_.Fit(batch.observations, advantages.target, random);
  report.entropy = Entropy(policy_);
  ++updates_;
  steps_ += batch.size();
  dropped_episodes_ += batch.dropped;
  return report;
}

double Trainer::Evaluate(const ParameterSampler& sample, int episodes) {
  return rollout_.Evaluate(policy_, sample, episodes, seed_, kEvaluationStream,
                           static_cast<uint32_t>(updates_));
}

}  // namespace plumb
