#include "trainer/trainer.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <utility>
#include <vector>

#include "trainer/gae.h"
#include "trainer/initialization.h"
#include "trainer/streams.h"

namespace plumb {
namespace {

constexpr int kJudgements = 16, kJudgementEpisodes = 30, kTrials = 40;
constexpr double kOutputGain = 0.01;  // of a fresh policy: every mean action is near 0

PolicyShape ShapeFor(const TrainingSettings& settings, const SimulationFactory& make,
                     const Eigen::VectorXd& action_scale) {
  const std::unique_ptr<Simulation> simulation = make();
  if (action_scale.size() != simulation->action_size())
    throw std::invalid_argument("trainer: size of action scale");
  return {simulation->observation_size(), settings.hidden, simulation->action_size()};
}

GaussianPolicy FreshPolicy(const TrainingSettings& settings, const PolicyShape& shape,
                           const Eigen::VectorXf& action_scale, Random random) {
  GaussianPolicy policy(shape);
  policy.action_scale = action_scale;
  const Eigen::VectorXf weights = OrthogonalParameters(policy.shape().sizes(), kOutputGain, random);
  policy.parameters.head(weights.size()) = weights;
  policy.parameters.tail(policy.shape().actions)
      .setConstant(static_cast<float>(std::log(settings.initial_sd)));
  return policy;
}

}  // namespace

TrainingSettings PaperSettings(TrainingSettings settings) {
  settings.starts = 1;
  settings.batch = 3000;
  settings.gamma = .995;
  settings.lambda = .97;
  settings.kl = .01;
  settings.normalise_values = false;
  settings.fisher_fraction = 1;
  settings.critic_epochs = 20;
  return settings;
}

std::vector<std::string> UpdateWarnings(int64_t update, const UpdateReport& report) {
  std::vector<std::string> warnings;
  if (!report.step.accepted)
    warnings.push_back(fmt::format("update {} skipped: {}", update, report.step.failure));
  if (!report.critic_fitted)
    warnings.push_back(fmt::format("update {}: the critic's fit was not finite", update));
  if (report.dropped_episodes > 0)
    warnings.push_back(
        fmt::format("update {}: {} episodes dropped, not finite", update, report.dropped_episodes));
  return warnings;
}

Trainer::Trainer(const TrainingSettings& settings, const SimulationFactory& make,
                 const Eigen::VectorXd& action_scale, uint64_t seed, int threads,
                 const Ranks& ranks)
    : settings_(settings),
      seed_(seed),
      ranks_(&ranks),
      workers_(threads),
      policy_(FreshPolicy(settings, ShapeFor(settings, make, action_scale),
                          action_scale.cast<float>(), Random(seed, {kPolicyStream}))),
      rollout_(make, policy_.shape(), workers_, ranks),
      trpo_(settings, policy_.shape(), workers_, ranks),
      critic_(settings, policy_.shape().observations, Random(seed, {kCriticStream}), workers_,
              ranks) {}

TrainerState Trainer::state() const {
  return {policy_, critic_.state(), observations_, updates_, steps_, dropped_episodes_, best_};
}

void Trainer::Restore(TrainerState state) {
  if (state.policy.shape() != policy_.shape() ||
      (state.best && state.best->policy.shape() != policy_.shape()))
    throw std::invalid_argument("trainer: state of another network");
  const auto fits = [&](const ObservationMoments& seen) {
    return seen.squares.size() == seen.mean.size() &&
           (seen.mean.size() == 0 || seen.mean.size() == policy_.shape().observations);
  };
  if (!fits(state.observations) || (state.best && !fits(state.best->observations)))
    throw std::invalid_argument("trainer: state of other observations");
  if (state.best) critic_.Restore(state.best->critic);  // throws now, if at all
  critic_.Restore(std::move(state.critic));
  policy_ = std::move(state.policy);
  observations_ = std::move(state.observations);
  updates_ = state.updates;
  steps_ = state.steps;
  dropped_episodes_ = state.dropped_episodes;
  best_ = std::move(state.best);
}

void Trainer::Start(const GaussianPolicy& policy) {
  if (policy.shape() != policy_.shape())
    throw std::invalid_argument("trainer: the policy to begin with is another network");
  policy_ = policy;
  settings_.starts = 1;
  if (!settings_.normalise_observations) return;
  observations_.count = static_cast<double>(settings_.updates) * settings_.batch;
  observations_.mean = policy.observation_mean.cast<double>();
  observations_.squares = observations_.count * policy.observation_scale.cast<double>().cwiseAbs2();
}

bool Trainer::starts_anew() const {
  return updates_ > 0 && updates_ < settings_.first_updates() && updates_ % settings_.updates == 0;
}

void Trainer::StartAnew() {
  const auto update = static_cast<uint32_t>(updates_);
  policy_ = FreshPolicy(settings_, policy_.shape(), policy_.action_scale,
                        Random(seed_, {kPolicyStream, update}));
  critic_.Restore(Critic(settings_, policy_.shape().observations,
                         Random(seed_, {kCriticStream, update}), workers_, *ranks_)
                      .state());
  observations_ = {};
}

UpdateReport Trainer::Update(const ParameterSampler& sample) {
  if (starts_anew()) StartAnew();
  const auto update = static_cast<uint32_t>(updates_);
  // Who cannot yet do it at all learns nothing from the worst of its failures.
  const int64_t of_start =
      updates_ < settings_.first_updates() ? updates_ % settings_.updates : updates_;
  const double share = of_start < settings_.worst_after ? 1 : settings_.worst_share;
  const Batch batch =
      rollout_.Collect(policy_, sample, settings_.batch, share, seed_, kRolloutStream, update);
  const std::vector<double> values = critic_.Values(batch.observations);
  const std::vector<double> final_values = critic_.Values(batch.final_observations);
  Advantages advantages = EstimateAdvantages(batch.rewards, values, batch.episodes, final_values,
                                             settings_.gamma, settings_.lambda);
  Normalize(advantages.advantage);

  UpdateReport report;
  report.batch = batch.size();
  report.dropped_episodes = batch.dropped;
  report.mean_return = batch.mean_return;
  report.explained_variance = ExplainedVariance(values, advantages.target);
  // Neither needs the other's result.
  workers_.Together(
      [&] {
        report.step =
            trpo_.Improve(policy_, {batch.observations, batch.actions, advantages.advantage});
      },
      [&] {
        Random random(seed_, {kFitStream, update});
        report.critic_fitted = critic_.Fit(batch.observations, advantages.target, random);
      });
  report.entropy = Entropy(policy_);
  // after the step: its batch was seen through the old normaliser
  if (settings_.normalise_observations) {
    observations_.Merge(batch.moments);
    policy_.observation_mean = observations_.mean.cast<float>();
    policy_.observation_scale = observations_.sd().cast<float>();
  }
  ++updates_;
  steps_ += batch.steps;
  dropped_episodes_ += batch.dropped;
  CompareRanks();
  return report;
}

void Trainer::CompareRanks() const {
  struct Sums {
    uint64_t policy, critic;  // bits of the parameters' sum: a difference in one parameter shows
    bool operator==(const Sums&) const = default;
  };
  const std::vector<Sums> sums = ranks_->Collect(
      Sums{std::bit_cast<uint64_t>(policy_.parameters.cast<double>().sum()),
           std::bit_cast<uint64_t>(critic_.state().parameters.cast<double>().sum())});
  for (size_t r = 1; r < sums.size(); ++r) {
    if (sums[r] != sums[0]) {
      throw std::runtime_error(
          fmt::format("rank {} has come to another policy or critic than rank 0 by update {}: do "
                      "all have the same files and "
                      "processors with the same instruction set (this one's: {})?",
                      r, updates_, kernels::InstructionSet()));
    }
  }
}

UpdateReport Trainer::UpdateJudged(const ParameterSampler& sample) {
  if (JudgementDue()) Judge(sample);
  return Update(sample);
}

bool Trainer::JudgementDue() const {
  return !best_ || starts_anew() || updates_ % std::max(1, settings_.updates / kJudgements) == 0;
}

void Trainer::Judge(const ParameterSampler& sample) {
  const double mean =
      MeanOfWorst(rollout_.Returns(policy_, sample, kJudgementEpisodes, seed_, kJudgementStream, 0),
                  settings_.worst_share);
  if (best_ && !std::isnan(best_->mean_return) && !(mean > best_->mean_return)) return;
  best_ = JudgedPolicy{policy_, critic_.state(), updates_, mean, observations_};
}

int64_t Trainer::ReturnToBest(const ParameterSampler& sample) {
  Judge(sample);
  const JudgedPolicy best = *std::exchange(best_, {});
  policy_ = best.policy;
  critic_.Restore(best.critic);
  observations_ = best.observations;
  return best.updates;
}

Evaluation Trainer::Evaluate(const ParameterSampler& sample, int episodes) {
  return plumb::Evaluate(rollout_.Returns(policy_, sample, episodes, seed_, kEvaluationStream,
                                          static_cast<uint32_t>(updates_)));
}

std::vector<double> Trainer::HeldOutReturns(const GaussianPolicy& policy,
                                            const ParameterSampler& sample, int episodes) {
  return rollout_.Returns(policy, sample, episodes, seed_, kHeldOutStream, 0);
}

std::vector<double> Trainer::TrialReturns(const SimulatorDraw& simulator, int trial_steps) {
  return rollout_.TrialReturns(
      policy_, [&](Random&) { return simulator; }, trial_steps, kTrials, seed_, kHeldOutStream, 0);
}

}  // namespace plumb
