#include "experiments/loop.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

#include "calibrator/live/calibrator.h"
#include "common/special_numbers.h"
#include "experiments/random_forces.h"
#include "trainer/acceptance.h"
#include "trainer/robot_simulation.h"

namespace plumb {
namespace {

// numbers of the episodes that judge: not those that are learnt from
constexpr uint32_t kJudges = 1u << 20, kTrials = 1u << 21;

// What the robot did with one policy in an iteration.
struct Use {
  std::vector<Rollout> rollouts;
  std::vector<Trial> trials;
  double seconds = 0;

  int Add(RobotEpisode episode, int iteration) {
    const auto made = static_cast<int>(episode.rollout.transitions.size());
    episode.rollout.policy_iteration = iteration;
    seconds += episode.seconds;
    rollouts.push_back(std::move(episode.rollout));
    return made;
  }
};

// So many transitions, in whole episodes but for the last; the first ones are trials, without
// exploration. A rest that is too short for a trial explores.
Use UseRobot(RealSystem& real, const GaussianPolicy& policy, int steps, int trial_steps,
             int iteration) {
  Use use;
  uint32_t number = 1000 * static_cast<uint32_t>(iteration);
  const int shortest = std::max(1, trial_steps / 4);
  for (int empty = 0; steps > 0; ++number) {
    const bool tries = trial_steps >= shortest;
    RobotEpisode episode = tries ? real.Run(policy, false, trial_steps, kTrials + number)
                                 : real.Run(policy, true, steps, number);
    if (tries) use.trials.push_back(episode.trial);
    const int made = use.Add(std::move(episode), iteration);
    steps -= made;
    if (tries) trial_steps -= made;
    if (made == 0 && ++empty > 10)
      throw std::runtime_error("the robot does not move: ten episodes without a transition");
  }
  return use;
}

}  // namespace

Loop::Loop(RobotDescription model, Eigen::VectorXd truth)
    : model_(std::move(model)), truth_(std::move(truth)) {}

std::unique_ptr<Trainer> Loop::MakeTrainer(const LoopSettings& settings) const {
  return std::make_unique<Trainer>(model_.training, SimulateRobot(model_), model_.effort_limits(),
                                   settings.seed, settings.threads);
}

void Loop::Train(Trainer& trainer, const ParameterSampler& sample, int updates,
                 const std::function<void(double)>& progress) {
  trainer.ForgetBest();
  for (int i = 0; i < updates; ++i) {
    trainer.UpdateJudged(sample);
    progress(static_cast<double>(i) / updates);
  }
  if (updates > 0) trainer.ReturnToBest(sample);
}

std::unique_ptr<Trainer> Loop::TrainFirst(const std::string& name,
                                          const ParameterDistribution& distribution,
                                          const LoopSettings& settings,
                                          const std::function<void(double)>& progress) {
  std::unique_ptr<Trainer> trainer = MakeTrainer(settings);
  const std::string key = fmt::format("{} {} {}", name, settings.seed, settings.first_updates);
  if (const auto known = first_.find(key); known != first_.end()) {
    trainer->Restore(known->second);
    return trainer;
  }
  Train(
      *trainer, [&](Random& random) { return distribution.Draw(random); }, settings.first_updates,
      progress);
  first_.emplace(key, trainer->state());
  return trainer;
}

/// One run of the loop, from the first policy to the judgement of the last.
class Loop::Running {
 public:
  Running(Loop& loop, RealSystem& real, const LoopSettings& settings,
          const std::function<void(double)>& progress)
      : real_(real), settings_(settings), calibrated_(loop.model_), acceptance_(steps()) {
    distribution_ = FirstDistribution(settings.strategy, loop.model_, loop.truth_);
    calibrated_.calibration.residual &= settings.residual;
    if (Learns(settings.strategy))
      simopt_ = MakeSimOpt(settings.strategy, calibrated_, settings.seed, settings.threads);
    const double all = settings.first_updates + settings.iterations * settings.next_updates;
    const double first = settings.first_updates / all, next = settings.next_updates / all;
    told_ = [=](int iteration, double share) { progress(first + next * (iteration + share)); };
    const auto begins = simopt_ ? CalibrationStrategy::kPrior : settings.strategy;
    trainer_ = loop.TrainFirst(Key(begins), distribution_, settings,
                               [=](double share) { progress(first * share); });
    if (settings.forces > 0)
      distribution_.residual = RandomForces(loop.model_, settings.forces, settings.seed);
  }

  LoopResult Run() {
    for (int iteration = 0;; ++iteration) {
      Judge(iteration);
      if (iteration == settings_.iterations) break;
      if (simopt_ || settings_.accept) {
        RollOut(iteration);
        if (simopt_) Calibrate();
        if (settings_.accept) Choose(iteration);
      }
      Train(*trainer_, sample_, settings_.next_updates,
            [&](double share) { told_(iteration, share); });
    }
    if (simopt_) result_.rollouts = simopt_->state().rollouts;
    return std::move(result_);
  }

 private:
  int steps() const { return calibrated_.task.steps; }

  void Judge(int iteration) {
    judged_.push_back(
        Loop::Judge(real_, trainer_->policy(), steps(), settings_.evaluation_episodes));
    if (!settings_.accept) deployed_ = iteration;
    const Judgement& deployed = judged_[static_cast<size_t>(deployed_)];
    result_.rows.push_back({iteration, deployed.mean, deployed.worst, judged_.back().mean,
                            deployed_,
                            trainer_->EvaluateHeldOut(sample_, settings_.evaluation_episodes).mean,
                            discrepancy_, distribution_.residual != nullptr, transitions_, seconds_,
                            distribution_.Mean(), distribution_.Sd()});
  }

  void RollOut(int iteration) {
    const int all = settings_.steps_per_iteration;
    Use use = UseRobot(real_, trainer_->policy(), all,
                       static_cast<int>(settings_.trial_share * all), iteration);
    seconds_ += use.seconds;
    transitions_ += static_cast<int64_t>(CountTransitions(use.rollouts));
    for (const Trial& trial : use.trials) acceptance_.Add(iteration, trial);
    if (simopt_) simopt_->Begin(std::move(use.rollouts));
  }

  void Calibrate() {
    std::optional<CalibrationReport> report;
    while (!(report = simopt_->Update())) {
    }
    discrepancy_ = report->discrepancy;
    distribution_ = DistributionOf(calibrated_, simopt_->state());
    for (Gaussian& component : distribution_.mixture.components)
      component.covariance *= settings_.tempering;
  }

  // Which policy is deployed from now on.
  void Choose(int iteration) {
    if (!incumbent_) incumbent_ = trainer_->policy();
    result_.decisions.push_back(
        Summary(acceptance_.Choose(*trainer_, *incumbent_, iteration, distribution_)));
    if (acceptance_.incumbent() == iteration)
      deployed_ = iteration, incumbent_ = trainer_->policy();
  }

  RealSystem& real_;
  const LoopSettings& settings_;
  RobotDescription calibrated_;
  std::unique_ptr<SimOpt> simopt_;  // null: nothing is learnt of the robot
  ParameterDistribution distribution_;
  const ParameterSampler sample_ = [this](Random& random) { return distribution_.Draw(random); };
  std::unique_ptr<Trainer> trainer_;
  std::function<void(int, double)> told_;
  Acceptance acceptance_;
  std::optional<GaussianPolicy> incumbent_;
  int deployed_ = 0;               // the iteration whose policy that is
  std::vector<Judgement> judged_;  // each iteration's policy
  int64_t transitions_ = 0;
  double seconds_ = 0, discrepancy_ = kNaN;
  LoopResult result_;
};

LoopResult Loop::Run(RealSystem& real, const LoopSettings& settings,
                     const std::function<void(double)>& progress) {
  return Running(*this, real, settings, progress).Run();
}

Loop::Judgement Loop::Judge(RealSystem& real, const GaussianPolicy& policy, int steps,
                            int episodes) {
  Judgement judgement{0, std::numeric_limits<double>::infinity()};
  for (int i = 0; i < episodes; ++i) {
    const double one =
        real.Run(policy, false, steps, kJudges + static_cast<uint32_t>(i)).sum_of_rewards;
    judgement.mean += one / episodes;
    judgement.worst = std::min(judgement.worst, one);
  }
  return judgement;
}

}  // namespace plumb
