#include "experiments/calibration_cost.h"

#include <fmt/format.h>

#include <cstdint>
#include <stdexcept>

#include "calibrator/live/calibrator.h"
#include "experiments/budget.h"
#include "experiments/loop.h"
#include "experiments/n_step_error.h"
#include "experiments/simulated_system.h"

namespace plumb {
namespace {

constexpr int kIterations = 5;  // TRPO updates of so many iterations follow
constexpr int kSimulators = 20;

// Of both SimOpts.
int Updates(const ExperimentOptions& options) { return options.quick ? 8 : 40; }
std::vector<int64_t> Budgets(const ExperimentOptions& options) {
  return options.quick ? std::vector<int64_t>{2000, 20'000, 100'000}
                       : std::vector<int64_t>{1000,   2000,    5000,    10'000, 20'000,
                                              50'000, 100'000, 200'000, 500'000};
}

}  // namespace

std::vector<int> TransitionCounts(const ExperimentOptions& options) {
  return options.quick ? std::vector<int>{50, 200}
                       : std::vector<int>{12, 25, 50, 100, 200, 400, 800};
}

Results::Rows CalibrationCost::Returns(const PaperTask& task, CalibrationStrategy strategy, int run,
                                       const std::function<void(double)>& progress) {
  Remember(task, run, progress);
  const RobotDescription& robot = now_.recording.robot;
  const std::vector<int> counts =
      strategy == CalibrationStrategy::kOracle || strategy == CalibrationStrategy::kPrior
          ? std::vector<int>{0}
          : TransitionCounts(options_);
  Results::Rows rows;
  for (size_t i = 0; i < counts.size(); ++i) {
    const ParameterDistribution distribution =
        Learns(strategy) ? Calibrated(strategy, counts[i], run)
                         : FirstDistribution(strategy, robot, now_.recording.hidden);
    const double share = static_cast<double>(i) / static_cast<double>(counts.size());
    rows.push_back({static_cast<double>(counts[i]), Trained(distribution, run, [&](double part) {
                      progress(share + part / static_cast<double>(counts.size()));
                    })});
  }
  return rows;
}

Results::Rows CalibrationCost::Errors(const PaperTask& task, CalibrationStrategy strategy, int run,
                                      const std::function<void(double)>& progress) {
  Remember(task, run, progress);
  const auto seed = static_cast<uint64_t>(run);
  const RobotDataset& recording = now_.recording;
  Results::Rows rows;
  const auto judge = [&](int64_t simulated, const ParameterDistribution& distribution) {
    const Eigen::VectorXd errors = NStepErrors(recording.robot, distribution, recording.held_out,
                                               kHorizon, kSimulators, 10, seed);
    rows.push_back({static_cast<double>(simulated), errors(kHorizon - 1)});
  };
  if (strategy == CalibrationStrategy::kDefault) {
    for (const int64_t budget : Budgets(options_)) {
      try {
        const BudgetedFit fit =
            FitWithin(recording.robot, recording.seen, budget, seed, options_.threads);
        judge(fit.simulated_steps, fit.distribution);
      } catch (const std::invalid_argument&) {  // too little for a fit: no point
      }
      progress(static_cast<double>(rows.size()) / static_cast<double>(Budgets(options_).size()));
    }
    return rows;
  }
  const auto simopt = MakeSimOpt(strategy, recording.robot, seed, options_.threads);
  int64_t simulated = 0;
  for (const Rollout& rollout : recording.seen) {
    simopt->Begin({rollout});
    simopt->Update();
    simulated += 25 * static_cast<int64_t>(rollout.transitions.size());
    judge(simulated, DistributionOf(recording.robot, simopt->state()));
    progress(static_cast<double>(rows.size()) / Updates(options_));
  }
  return rows;
}

void CalibrationCost::Remember(const PaperTask& task, int run,
                               const std::function<void(double)>& progress) {
  const std::string of = fmt::format("{} {}", task.name, run);
  if (now_.of == of) return;
  const RobotDescription robot = LoadTask(options_.robots, task, options_.hidden);
  const RecordingSettings settings{options_.quick ? 40 : robot.training.first_updates(),
                                   Updates(options_),
                                   1,
                                   options_.hidden,
                                   static_cast<uint64_t>(run),
                                   options_.threads};
  now_ = {of, Record(robot, settings, progress)};
}

ParameterDistribution CalibrationCost::Calibrated(CalibrationStrategy strategy, int transitions,
                                                  int run) const {
  const RobotDescription& robot = now_.recording.robot;
  const auto simopt = MakeSimOpt(strategy, robot, static_cast<uint64_t>(run), options_.threads);
  // The same transitions again and again: an iteration is an update.
  const std::vector<Rollout> some = FirstTransitions(now_.recording.seen, transitions);
  for (int i = 0; i < (strategy == CalibrationStrategy::kDefault ? 1 : Updates(options_)); ++i) {
    simopt->Begin(some);
    simopt->Update();
  }
  return DistributionOf(robot, simopt->state());
}

// Return on the robot of a policy that went on from the first one.
double CalibrationCost::Trained(const ParameterDistribution& distribution, int run,
                                const std::function<void(double)>& progress) {
  const RobotDescription& robot = now_.recording.robot;
  LoopSettings settings;
  settings.seed = static_cast<uint64_t>(run);
  settings.threads = options_.threads;
  settings.first_updates = options_.quick ? 40 : robot.training.first_updates();
  const auto trainer = now_.recording.loop->TrainFirst(
      Key(CalibrationStrategy::kPrior), ParameterDistribution::Prior(robot), settings, progress);
  const int updates = options_.quick ? 1 : kIterations * robot.training.updates_again;
  for (int i = 0; i < updates; ++i) {
    trainer->Update([&](Random& random) { return distribution.Draw(random); });
    progress(static_cast<double>(i) / updates);
  }
  SimulatedSystem real(robot, now_.recording.hidden, ReadingNoise(robot), settings.seed);
  return Loop::Judge(real, trainer->policy(), robot.task.steps, options_.quick ? 2 : 20).mean;
}

}  // namespace plumb
