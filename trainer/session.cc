#include "trainer/session.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "sim/residual_inputs.h"

namespace plumb {
namespace {

constexpr int kHeldOut = 50;  // simulators
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

}  // namespace

TrainingSession::TrainingSession(const RobotDescription& description, const SimulationFactory& make,
                                 int iterations, uint64_t seed, int threads)
    : description_(description),
      iterations_(iterations),
      seed_(seed),
      trainer_(description.training, make, description.effort_limits(), seed, threads) {}

int TrainingSession::updates() const {
  return iteration_ == 0 ? description_.training.updates : description_.training.updates_again;
}

int TrainingSession::awaited() const {
  if (!begun_) return 0;
  return complete_ && iteration_ < iterations_ ? iteration_ + 1 : -1;
}

bool TrainingSession::Begin(const ParameterDistribution& distribution) {
  if (distribution.iteration != awaited()) return false;
  if (distribution.residual) RequireResidualOf(description_, *distribution.residual);
  distribution_ = distribution;
  iteration_ = distribution.iteration;
  begun_ = true;
  complete_ = false;
  update_ = 0;
  evaluation_ = {};
  return true;
}

bool TrainingSession::Replace(const ParameterDistribution& distribution) {
  if (!training() || distribution.iteration != iteration_ ||
      distribution.mixture == distribution_.mixture)
    return false;
  if (distribution.residual) RequireResidualOf(description_, *distribution.residual);
  distribution_ = distribution;
  trainer_.ForgetBest();
  return true;
}

UpdateReport TrainingSession::Advance() {
  const ParameterSampler sample = [this](Random& random) { return distribution_.Draw(random); };
  if (update_ < updates()) {
    if (trainer_.JudgementDue()) trainer_.Judge(sample);
    last_ = trainer_.Update(sample);
    ++update_;
  }
  if (update_ >= updates()) {
    trainer_.ReturnToBest(sample);
    evaluation_ = trainer_.EvaluateHeldOut(sample, kHeldOut);
    complete_ = true;
  }
  return last_;
}

policy_t TrainingSession::Policy(int evaluation_episodes) const {
  policy_t message = trainer_.policy().ToMessage();
  message.iteration = iteration_;
  message.purpose = finished() ? policy_t::EVALUATE : policy_t::CALIBRATE;
  message.episodes = finished() ? evaluation_episodes : 1;
  message.trial_steps = 0;
  return message;
}

training_status_t TrainingSession::Status() const {
  training_status_t status;
  status.utime = 0;
  status.seconds = kUnknown;
  status.iteration = iteration_;
  status.update = update_;
  status.updates = updates();
  status.steps = trainer_.steps();
  const bool any = last_.batch > 0;  // in this run of the process
  status.mean_return = any ? last_.mean_return : kUnknown;
  status.kl = any ? last_.step.kl : kUnknown;
  status.surrogate_gain = any ? last_.step.surrogate_gain : kUnknown;
  status.explained_variance = any ? last_.explained_variance : kUnknown;
  status.entropy = Entropy(trainer_.policy());
  status.evaluation_return = evaluation_.mean;
  status.evaluation_tenth = evaluation_.tenth;
  status.evaluation_worst = evaluation_.worst;
  status.complete = complete_;
  return status;
}

Checkpoint TrainingSession::MakeCheckpoint() const {
  Checkpoint checkpoint;
  SetTrainerState(trainer_.state(), checkpoint);
  checkpoint.seed = seed_;
  checkpoint.iteration = iteration_, checkpoint.iteration_updates = update_,
  checkpoint.complete = complete_;
  checkpoint.evaluation = evaluation_;
  checkpoint.distribution = distribution_.ToMessage();
  return checkpoint;
}

void TrainingSession::Restore(const Checkpoint& checkpoint) {
  if (checkpoint.seed != seed_) {
    throw CheckpointError(
        fmt::format("the checkpoint is of a run with seed {}, not {}", checkpoint.seed, seed_));
  }
  if (checkpoint.iteration < 0 || checkpoint.iteration > iterations_) {
    throw CheckpointError(fmt::format("the checkpoint stands at iteration {}, beyond {}",
                                      checkpoint.iteration, iterations_));
  }
  try {
    distribution_ = ParameterDistribution::FromMessage(checkpoint.distribution, description_);
    trainer_.Restore(TrainerStateOf(checkpoint));
  } catch (const std::invalid_argument& error) {
    throw CheckpointError(
        fmt::format("the checkpoint is of another robot or network: {}", error.what()));
  }
  begun_ = true;
  iteration_ = checkpoint.iteration;
  update_ = checkpoint.iteration_updates;
  complete_ = checkpoint.complete;
  evaluation_ = checkpoint.evaluation;
}

}  // namespace plumb
