#include "trainer/session.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <stdexcept>
#include <utility>
#include <vector>

#include "common/lcm_datagrams.h"
#include "common/message_bytes.h"
#include "common/seal.h"
#include "common/special_numbers.h"
#include "sim/residual_inputs.h"
#include "sim/tasks/task.h"
#include "trainer/policy_file.h"

namespace plumb {
namespace {

constexpr int kHeldOut = 50;             // simulators
constexpr int kTried = 20;               // of a distribution, before it is trained with
constexpr int kTrialAndExploration = 2;  // episodes of a roll-out that begins with a trial

// What a status tells of an update.
UpdateReport ReportOf(const training_status_t& status) {
  UpdateReport report;
  report.batch = 1;  // there was one
  report.mean_return = status.mean_return;
  report.step.kl = status.kl, report.step.surrogate_gain = status.surrogate_gain;
  report.explained_variance = status.explained_variance;
  return report;
}

}  // namespace

void RequireSendable(const GaussianPolicy& policy) {
  const double megabyte = 1 << 20;
  const auto size = static_cast<size_t>(policy.ToMessage().getEncodedSize()) + kSealSize;
  if (size <= kMaxLcmMessage) return;
  throw std::invalid_argument(fmt::format(
      "its policy is a message of {:.1f} MB, and what has more than {:.0f} MB gets through to "
      "nobody: take fewer units",
      static_cast<double>(size) / megabyte, static_cast<double>(kMaxLcmMessage) / megabyte));
}

void RequireSendable(const RobotDescription& robot) {
  const auto task = MakeTask(robot);
  try {
    RequireSendable(
        GaussianPolicy({task->observation_size(), robot.training.hidden, task->action_size()}));
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(fmt::format("[training] hidden: {}", error.what()));
  }
}

GaussianPolicy LoadSendablePolicy(const std::string& file, const RobotDescription& robot) {
  GaussianPolicy policy = LoadPolicy(file, robot, *MakeTask(robot));
  RequireTrained(file, robot);
  try {
    RequireSendable(policy);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(fmt::format("{}: {}", file, error.what()));
  }
  return policy;
}

TrainingSession::TrainingSession(const RobotDescription& description, const SimulationFactory& make,
                                 int iterations, uint64_t seed, int threads)
    : description_(description),
      iterations_(iterations),
      seed_(seed),
      trainer_(description.training, make, description.effort_limits(), seed, threads),
      acceptance_(description.task.steps) {
  RequireSendable(description);
}

int TrainingSession::updates() const {
  return iteration_ == 0 ? description_.training.first_updates()
                         : description_.training.updates_again;
}

int TrainingSession::awaited() const {
  if (!begun_) return 0;
  return complete_ && iteration_ < iterations_ ? iteration_ + 1 : -1;
}

// Of a roll-out; its other steps are for exploration.
int TrainingSession::trial_steps() const {
  const int all = description_.task.steps;
  if (description_.training.trial <= 0 || all < 2) return 0;
  return std::clamp(static_cast<int>(description_.training.trial * all), 1, all - 1);
}

bool TrainingSession::awaits_trial() const {
  return trial_steps() > 0 && complete_ && !finished() &&
         !acceptance_.trials().contains(iteration_);
}

bool TrainingSession::AddTrial(const controller_status_t& status) {
  if (!awaits_trial() || status.phase != controller_status_t::COMPLETE ||
      status.purpose != policy_t::CALIBRATE || status.policy_iteration != iteration_)
    return false;
  // Anybody can send anything.
  const auto complete = [](const auto& values) { return values.size() == kTrialAndExploration; };
  if (status.num_episodes != kTrialAndExploration || !complete(status.steps) ||
      !complete(status.returns) || !complete(status.late_rate) || !complete(status.fell))
    return false;
  const Trial trial{status.steps[0], status.returns[0], status.late_rate[0], status.fell[0] != 0};
  if (trial.steps < 0 || trial.steps > trial_steps() || !std::isfinite(trial.sum_of_rewards) ||
      !std::isfinite(trial.late_rate))
    return false;
  acceptance_.Add(iteration_, trial);
  if (!incumbent_policy_) incumbent_policy_ = trainer_.policy(), incumbent_since_ = iteration_;
  return true;
}

// The decision on the newest policy, made in an iteration.
void TrainingSession::Adopt(const Acceptance::Decision& decision, int iteration) {
  decision_ = decision;
  if (!decision.accepted || decision.challenger == decision.incumbent) return;
  incumbent_policy_ = trainer_.policy();
  incumbent_since_ = iteration;
}

int TrainingSession::incumbent() const {
  if (trial_steps() > 0) return acceptance_.incumbent();
  return complete_ ? iteration_ : iteration_ - 1;
}

int TrainingSession::incumbent_since() const {
  return trial_steps() > 0 ? incumbent_since_ : incumbent();
}

// Anybody can send anything: training with simulators that cannot be simulated would end.
void TrainingSession::RequireSimulable(const ParameterDistribution& distribution) {
  const Evaluation tried =
      trainer_.EvaluateHeldOut([&](Random& random) { return distribution.Draw(random); }, kTried);
  if (2 * tried.failed < tried.episodes) return;
  throw std::invalid_argument(
      fmt::format("parameter distribution: of {} simulators drawn from it {} cannot be simulated",
                  tried.episodes, tried.failed));
}

bool TrainingSession::Begin(const ParameterDistribution& distribution) {
  if (distribution.iteration != awaited() || awaits_trial()) return false;
  if (distribution.residual) RequireResidualOf(description_, *distribution.residual);
  RequireSimulable(distribution);
  if (complete_ && trial_steps() > 0)
    Adopt(acceptance_.Choose(trainer_, *incumbent_policy_, iteration_, distribution),
          distribution.iteration);
  distribution_ = distribution;
  iteration_ = distribution.iteration;
  begun_ = true;
  complete_ = false;
  update_ = 0;
  evaluation_ = {};
  return true;
}

bool TrainingSession::Replace(const ParameterDistribution& distribution) {
  if (!training() || distribution.iteration != iteration_) return false;
  if (distribution.residual) RequireResidualOf(description_, *distribution.residual);
  if (Encode(distribution.ToMessage()) == Encode(distribution_.ToMessage())) return false;
  RequireSimulable(distribution);
  distribution_ = distribution;
  trainer_.ForgetBest();
  return true;
}

UpdateReport TrainingSession::Advance() {
  const ParameterSampler sample = [this](Random& random) { return distribution_.Draw(random); };
  if (update_ < updates()) {
    last_ = trainer_.UpdateJudged(sample);
    ++update_;
  }
  if (update_ >= updates()) {
    trainer_.ReturnToBest(sample);
    evaluation_ = trainer_.EvaluateHeldOut(sample, kHeldOut);
    complete_ = true;
    // The last one has no trial: it is trusted, or nothing but one that has had a trial is run.
    if (finished() && trial_steps() > 0 && (distribution_.explained || !incumbent_policy_))
      Adopt(acceptance_.Trust(iteration_, {}), iteration_);
  }
  return last_;
}

policy_t TrainingSession::Policy(int evaluation_episodes) const {
  const bool chosen = finished() && trial_steps() > 0 && incumbent_policy_;
  policy_t message = (chosen ? *incumbent_policy_ : trainer_.policy()).ToMessage();
  message.iteration = iteration_;
  message.trained_in = chosen ? incumbent() : iteration_;
  message.purpose = finished() ? policy_t::EVALUATE : policy_t::CALIBRATE;
  message.trial_steps = finished() ? 0 : trial_steps();
  message.episodes = finished()                ? evaluation_episodes
                     : message.trial_steps > 0 ? kTrialAndExploration
                                               : 1;
  return message;
}

training_status_t TrainingSession::Status() const {
  training_status_t status;
  status.utime = 0;
  status.seconds = kNaN;
  status.iteration = iteration_;
  status.update = update_;
  status.updates = updates();
  status.steps = trainer_.steps();
  status.dropped_episodes = trainer_.dropped_episodes();
  const bool any = last_.batch > 0;  // in this run of the process
  status.mean_return = any ? last_.mean_return : kNaN;
  status.kl = any ? last_.step.kl : kNaN;
  status.surrogate_gain = any ? last_.step.surrogate_gain : kNaN;
  status.explained_variance = any ? last_.explained_variance : kNaN;
  status.entropy = Entropy(trainer_.policy());
  status.evaluation_return = evaluation_.mean;
  status.evaluation_tenth = evaluation_.tenth;
  status.evaluation_worst = evaluation_.worst;
  status.complete = complete_;
  status.incumbent = incumbent();
  status.incumbent_since = incumbent_since();
  const bool chosen = decision_.challenger >= 0;
  status.decision = chosen ? Summary(decision_) : "";
  status.challenger = decision_.challenger;
  status.probability = chosen ? decision_.probability : kNaN;
  status.challenger_return = chosen ? decision_.challenger_return : kNaN;
  status.incumbent_return = chosen ? decision_.incumbent_return : kNaN;
  return status;
}

Checkpoint TrainingSession::MakeCheckpoint() const {
  Checkpoint checkpoint;
  SetTrainerState(trainer_.state(), checkpoint);
  checkpoint.seed = seed_;
  checkpoint.robot = description_.fingerprint;
  checkpoint.iteration = iteration_, checkpoint.iteration_updates = update_,
  checkpoint.complete = complete_;
  checkpoint.evaluation = evaluation_;
  checkpoint.distribution = distribution_.ToMessage();
  for (const auto& [iteration, trials] : acceptance_.trials())
    for (const Trial& trial : trials) checkpoint.trials.push_back({iteration, trial});
  checkpoint.decision = decision_;
  checkpoint.incumbent_since = incumbent_since_;
  if (incumbent_policy_) {
    checkpoint.incumbent = acceptance_.incumbent();
    checkpoint.incumbent_policy = incumbent_policy_->ToMessage();
  }
  return checkpoint;
}

void TrainingSession::Restore(const Checkpoint& checkpoint) {
  RequireContinues(checkpoint, description_.fingerprint, seed_, iterations_);
  try {
    distribution_ = ParameterDistribution::FromMessage(checkpoint.distribution, description_);
    trainer_.Restore(TrainerStateOf(checkpoint));
    incumbent_policy_.reset();
    if (checkpoint.incumbent >= 0)
      incumbent_policy_ = GaussianPolicy::FromMessage(checkpoint.incumbent_policy);
  } catch (const std::invalid_argument& error) {
    throw CheckpointError(
        fmt::format("the checkpoint is of another robot or network: {}", error.what()));
  }
  std::map<int, std::vector<Trial>> trials;
  for (const TriedPolicy& tried : checkpoint.trials) trials[tried.iteration].push_back(tried.trial);
  acceptance_ = Acceptance(description_.task.steps, std::move(trials), checkpoint.incumbent);
  decision_ = checkpoint.decision;
  incumbent_since_ = checkpoint.incumbent_since;
  begun_ = true;
  iteration_ = checkpoint.iteration;
  update_ = checkpoint.iteration_updates;
  complete_ = checkpoint.complete;
  evaluation_ = checkpoint.evaluation;
  last_ = checkpoint.statuses.empty() ? UpdateReport{} : ReportOf(checkpoint.statuses.back());
}

}  // namespace plumb
