#include "experiments/loop.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

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
    if (trainer.JudgementDue()) trainer.Judge(sample);
    trainer.Update(sample);
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

LoopResult Loop::Run(RealSystem& real, const LoopSettings& settings,
                     const std::function<void(double)>& progress) {
  ParameterDistribution distribution = FirstDistribution(settings.strategy, model_, truth_);
  RobotDescription calibrated = model_;
  calibrated.calibration.residual = model_.calibration.residual && settings.residual;
  const std::unique_ptr<SimOpt> simopt =
      Learns(settings.strategy)
          ? MakeSimOpt(settings.strategy, calibrated, settings.seed, settings.threads)
          : nullptr;
  const double all = settings.first_updates + settings.iterations * settings.next_updates;
  const double first = settings.first_updates / all, next = settings.next_updates / all;
  const std::unique_ptr<Trainer> trainer = TrainFirst(
      Learns(settings.strategy) ? Key(CalibrationStrategy::kPrior) : Key(settings.strategy),
      distribution, settings, [&](double share) { progress(first * share); });
  if (settings.forces > 0)
    distribution.residual = RandomForces(model_, settings.forces, settings.seed);
  const ParameterSampler sample = [&](Random& random) { return distribution.Draw(random); };
  LoopResult result;
  Acceptance acceptance(model_.task.steps);
  std::optional<GaussianPolicy> incumbent;
  int deployed_iteration = 0;
  int64_t transitions = 0;
  double seconds = 0, discrepancy = std::numeric_limits<double>::quiet_NaN();
  std::vector<Judgement> judged;  // of each iteration's policy
  for (int iteration = 0;; ++iteration) {
    judged.push_back(
        Judge(real, trainer->policy(), model_.task.steps, settings.evaluation_episodes));
    if (!settings.accept) deployed_iteration = iteration;
    const Judgement& deployed = judged[static_cast<size_t>(deployed_iteration)];
    result.rows.push_back({iteration, deployed.mean, deployed.worst, judged.back().mean,
                           deployed_iteration,
                           trainer->EvaluateHeldOut(sample, settings.evaluation_episodes).mean,
                           discrepancy, distribution.residual != nullptr, transitions, seconds,
                           distribution.Mean(), distribution.Sd()});
    if (iteration == settings.iterations) break;
    if (simopt || settings.accept) {
      const int steps = settings.steps_per_iteration;
      Use use = UseRobot(real, trainer->policy(), steps,
                         static_cast<int>(settings.trial_share * steps), iteration);
      seconds += use.seconds;
      transitions += static_cast<int64_t>(CountTransitions(use.rollouts));
      for (const Trial& trial : use.trials) acceptance.Add(iteration, trial);
      if (simopt) {
        simopt->Begin(std::move(use.rollouts));
        std::optional<CalibrationReport> report;
        while (!(report = simopt->Update())) {
        }
        discrepancy = report->discrepancy;
        distribution = DistributionOf(*simopt, model_);
        for (Gaussian& component : distribution.mixture.components)
          component.covariance *= settings.tempering;
      }
      if (settings.accept) {
        const bool right = simopt && calibrated.calibration.residual && !simopt->state().residual;
        const double scatter = trainer->ScatterOfStarts(distribution.Mean());
        if (!incumbent) incumbent = trainer->policy();
        const auto simulated = [&](const GaussianPolicy& policy) {
          return trainer->EvaluateHeldOut(policy, sample, Acceptance::kSimulators).mean;
        };
        const Acceptance::Decision decision =
            right ? acceptance.Trust(iteration, scatter)
                  : acceptance.Decide(iteration, scatter,
                                      {simulated(trainer->policy()), simulated(*incumbent)});
        result.decisions.push_back(Summary(decision));
        if (acceptance.incumbent() == iteration)
          deployed_iteration = iteration, incumbent = trainer->policy();
      }
    }
    Train(*trainer, sample, settings.next_updates,
          [&](double share) { progress(first + next * (iteration + share)); });
  }
  if (simopt) result.rollouts = simopt->state().rollouts;
  return result;
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
