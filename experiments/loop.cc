#include "experiments/loop.h"

#include <fmt/format.h>

#include <limits>

#include "trainer/robot_simulation.h"

namespace plumb {
namespace {

// numbers of the episodes that judge: not those that are learnt from
constexpr uint32_t kJudges = 1u << 20;

// So many transitions of one policy, in whole episodes but for the last.
std::vector<Rollout> RollOut(RealSystem& real, const GaussianPolicy& policy, int steps,
                             int iteration, double* seconds) {
  std::vector<Rollout> rollouts;
  for (uint32_t number = 0; steps > 0; ++number) {
    RobotEpisode episode =
        real.Run(policy, true, steps, 1000 * static_cast<uint32_t>(iteration) + number);
    const auto made = static_cast<int>(episode.rollout.transitions.size());
    if (made == 0 && number > 10)
      throw std::runtime_error("the robot does not move: ten episodes without a transition");
    episode.rollout.policy_iteration = iteration;
    *seconds += episode.seconds;
    steps -= made;
    rollouts.push_back(std::move(episode.rollout));
  }
  return rollouts;
}

}  // namespace

Loop::Loop(RobotDescription model, Eigen::VectorXd truth)
    : model_(std::move(model)), truth_(std::move(truth)) {}

std::unique_ptr<Trainer> Loop::MakeTrainer(const LoopSettings& settings) const {
  return std::make_unique<Trainer>(model_.training, SimulateRobot(model_), model_.effort_limits(),
                                   settings.seed, settings.threads);
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
  for (int i = 0; i < settings.first_updates; ++i) {
    trainer->Update([&](Random& random) { return distribution.Sample(random); });
    progress(static_cast<double>(i) / settings.first_updates);
  }
  first_.emplace(key, trainer->state());
  return trainer;
}

LoopResult Loop::Run(RealSystem& real, const LoopSettings& settings,
                     const std::function<void(double)>& progress) {
  ParameterDistribution distribution = FirstDistribution(settings.strategy, model_, truth_);
  const std::unique_ptr<SimOpt> simopt =
      Learns(settings.strategy)
          ? MakeSimOpt(settings.strategy, model_, settings.seed, settings.threads)
          : nullptr;
  const double all = settings.first_updates + settings.iterations * settings.next_updates;
  const double first = settings.first_updates / all, next = settings.next_updates / all;
  const std::unique_ptr<Trainer> trainer = TrainFirst(
      Learns(settings.strategy) ? Key(CalibrationStrategy::kPrior) : Key(settings.strategy),
      distribution, settings, [&](double share) { progress(first * share); });
  const ParameterSampler sample = [&](Random& random) { return distribution.Sample(random); };
  LoopResult result;
  int64_t transitions = 0;
  double seconds = 0, discrepancy = std::numeric_limits<double>::quiet_NaN();
  for (int iteration = 0;; ++iteration) {
    result.rows.push_back(
        {iteration, Judge(real, trainer->policy(), model_.task.steps, settings.evaluation_episodes),
         trainer->EvaluateHeldOut(sample, settings.evaluation_episodes).mean, discrepancy,
         transitions, seconds, distribution.Mean(), distribution.Sd()});
    if (iteration == settings.iterations) break;
    if (simopt) {
      std::vector<Rollout> rollouts =
          RollOut(real, trainer->policy(), settings.steps_per_iteration, iteration, &seconds);
      transitions += static_cast<int64_t>(CountTransitions(rollouts));
      simopt->Begin(std::move(rollouts));
      std::optional<CalibrationReport> report;
      while (!(report = simopt->Update())) {
      }
      discrepancy = report->discrepancy;
      distribution = DistributionOf(*simopt, model_);
    }
    for (int i = 0; i < settings.next_updates; ++i) {
      trainer->Update(sample);
      progress(first + next * (iteration + static_cast<double>(i) / settings.next_updates));
    }
  }
  if (simopt) result.rollouts = simopt->state().rollouts;
  return result;
}

double Loop::Judge(RealSystem& real, const GaussianPolicy& policy, int steps, int episodes) {
  double sum = 0;
  for (int i = 0; i < episodes; ++i)
    sum += real.Run(policy, false, steps, kJudges + static_cast<uint32_t>(i)).sum_of_rewards;
  return sum / episodes;
}

}  // namespace plumb
