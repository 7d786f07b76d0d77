// The cost of calibration, by each method: transitions of the robot until a policy that is trained
// on their posterior earns nearly as much as the oracle's, and simulated steps until simulators
// predict the robot to a given error.
//
// A policy trained on the prior moves a robot whose parameters are drawn for each run, as in
// Figures 2 and 3.
//   robot: N transitions of it calibrate (both SimOpts make 40 updates of 25 simulators on them);
//          then every strategy trains as much, from the same policy on.
//   simulator: 40 roll-outs calibrate, one an update, or for the default as many of their
//          transitions as the budget allows.
//
//   plumb-sample-efficiency robots --output sample_efficiency
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <iostream>
#include <utility>

#include "common/atomic_file.h"
#include "common/examples.h"
#include "common/median.h"
#include "experiments/budget.h"
#include "experiments/jobs.h"
#include "experiments/n_step_error.h"
#include "experiments/options.h"
#include "experiments/oracle.h"
#include "experiments/provenance.h"
#include "experiments/recording.h"
#include "experiments/simulated_system.h"
#include "plot/curves.h"

namespace plumb {
namespace {

constexpr CalibrationStrategy kStrategies[] = {
    CalibrationStrategy::kOriginal, CalibrationStrategy::kStep, CalibrationStrategy::kDefault};
constexpr int kIterations = 5;    // TRPO updates of so many iterations follow
constexpr double kEnough = 0.95;  // of the oracle's return
constexpr int kHorizon = 10, kSimulators = 20;
constexpr double kTargets[] = {0.01, 0.001};  // errors after kHorizon steps, standard units

// Of both SimOpts.
int Updates(const ExperimentOptions& options) { return options.quick ? 8 : 40; }
std::vector<int> TransitionCounts(const ExperimentOptions& options) {
  return options.quick ? std::vector<int>{50, 200}
                       : std::vector<int>{12, 25, 50, 100, 200, 400, 800};
}
std::vector<int64_t> Budgets(const ExperimentOptions& options) {
  return options.quick ? std::vector<int64_t>{2000, 20'000, 100'000}
                       : std::vector<int64_t>{1000,   2000,    5000,    10'000, 20'000,
                                              50'000, 100'000, 200'000, 500'000};
}
std::string KeyOf(const PaperTask& task, CalibrationStrategy strategy, int run) {
  return fmt::format("{},{},{}", task.name, Key(strategy), run);
}

struct Remembered {
  std::string of;
  RobotDataset recording;
};

class Experiment {
 public:
  explicit Experiment(const ExperimentOptions& options) : options_(options) {}

  Results::Rows Robot(const PaperTask& task, CalibrationStrategy strategy, int run,
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

  Results::Rows Simulator(const PaperTask& task, CalibrationStrategy strategy, int run,
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
      judge(simulated, DistributionOf(*simopt, recording.robot));
      progress(static_cast<double>(rows.size()) / Updates(options_));
    }
    return rows;
  }

 private:
  void Remember(const PaperTask& task, int run, const std::function<void(double)>& progress) {
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

  ParameterDistribution Calibrated(CalibrationStrategy strategy, int transitions, int run) const {
    const RobotDescription& robot = now_.recording.robot;
    const auto simopt = MakeSimOpt(strategy, robot, static_cast<uint64_t>(run), options_.threads);
    // The same transitions again and again: an iteration is an update.
    const std::vector<Rollout> some = FirstTransitions(now_.recording.seen, transitions);
    for (int i = 0; i < (strategy == CalibrationStrategy::kDefault ? 1 : Updates(options_)); ++i) {
      simopt->Begin(some);
      simopt->Update();
    }
    return DistributionOf(*simopt, robot);
  }

  // Return on the robot of a policy that went on from the first one.
  double Trained(const ParameterDistribution& distribution, int run,
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

  ExperimentOptions options_;
  Remembered now_;
};

// Means over the runs, of each row of a strategy.
std::vector<Band> Bands(const ExperimentOptions& options, const PaperTask& task,
                        CalibrationStrategy strategy, const Results& results, bool logarithmic) {
  std::vector<Band> bands;
  size_t rows = SIZE_MAX;
  for (int run = 1; run <= options.runs; ++run)
    rows = std::min(rows, results.Of(KeyOf(task, strategy, run)).size());
  for (size_t i = 0; i < rows; ++i) {
    std::vector<double> values;
    for (int run = 1; run <= options.runs; ++run) {
      const auto& all = results.Of(KeyOf(task, strategy, run));
      // what was too little for a fit in one run is missing at the beginning
      values.push_back(all[all.size() - rows + i][1]);
    }
    bands.push_back(ConfidenceBand(values, logarithmic));
  }
  return bands;
}

std::vector<double> FirstColumn(const ExperimentOptions& options, const PaperTask& task,
                                CalibrationStrategy strategy, const Results& results) {
  const size_t rows = Bands(options, task, strategy, results, false).size();
  std::vector<double> means(rows, 0);
  for (int run = 1; run <= options.runs; ++run) {
    const auto& all = results.Of(KeyOf(task, strategy, run));
    for (size_t i = 0; i < rows; ++i) means[i] += all[all.size() - rows + i][0] / options.runs;
  }
  return means;
}

Curve CurveOf(const ExperimentOptions& options, const PaperTask& task, CalibrationStrategy strategy,
              const Results& results, bool logarithmic) {
  Curve curve{Label(strategy), FirstColumn(options, task, strategy, results), {}, {}, {}};
  for (const Band& band : Bands(options, task, strategy, results, logarithmic)) {
    curve.middle.push_back(band.middle), curve.low.push_back(band.low),
        curve.high.push_back(band.high);
  }
  return curve;
}

// The first x from which on y is that good; "never" if it does not end so.
std::string Needed(const std::vector<double>& x, const std::vector<double>& y,
                   const std::function<bool(double)>& good) {
  size_t i = x.size();
  while (i > 0 && good(y[i - 1])) --i;
  return i == x.size() ? "never" : fmt::format("{:.0f}", x[i]);
}

std::string SettingsOf(const ExperimentOptions& options) {
  return fmt::format("drawn from {}{}, {}", Key(options.hidden), options.quick ? ", quick" : "",
                     Provenance(LoadTasks(options.robots, options.hidden)));
}

// A strategy's share of the oracle's return on the same robot: the median of the runs, for each
// number of transitions.
std::vector<double> Shares(const ExperimentOptions& options, const PaperTask& task,
                           CalibrationStrategy strategy, const Results& results) {
  std::vector<double> medians;
  for (size_t i = 0; i < results.Of(KeyOf(task, strategy, 1)).size(); ++i) {
    std::vector<double> shares;
    for (int run = 1; run <= options.runs; ++run) {
      shares.push_back(
          ShareOfOracle(results.Of(KeyOf(task, strategy, run))[i][1],
                        results.Of(KeyOf(task, CalibrationStrategy::kOracle, run))[0][1]));
    }
    medians.push_back(Median(std::move(shares)));
  }
  return medians;
}

int Measure(Process& process, const ExperimentOptions& options) {
  const std::filesystem::path folder = options.output;
  const Ranks ranks;
  Results robot(folder / "sample_efficiency_robot.csv", SettingsOf(options), {"task", "way", "run"},
                {"transitions", "robot_return"}, ranks);
  Results simulator(folder / "sample_efficiency_simulator.csv", SettingsOf(options),
                    {"task", "way", "run"}, {"simulated_steps", "error"}, ranks);
  Experiment experiment(options);
  std::vector<Job> robot_jobs, simulator_jobs;
  for (const PaperTask& task : kPaperTasks) {
    const TrainingSettings training = LoadTask(options.robots, task, options.hidden).training;
    for (int run = 1; run <= options.runs; ++run) {
      for (const CalibrationStrategy strategy :
           {CalibrationStrategy::kOriginal, CalibrationStrategy::kStep,
            CalibrationStrategy::kDefault, CalibrationStrategy::kPrior,
            CalibrationStrategy::kOracle}) {
        const double weight =
            Learns(strategy) ? static_cast<double>(TransitionCounts(options).size()) : 1;
        robot_jobs.push_back({KeyOf(task, strategy, run),
                              weight * training.batch * training.updates_again, run,
                              [&, strategy, run](const auto& progress) {
                                return experiment.Robot(task, strategy, run, progress);
                              }});
        if (!Learns(strategy)) continue;
        simulator_jobs.push_back(
            {KeyOf(task, strategy, run), 1, run, [&, strategy, run](const auto& progress) {
               return experiment.Simulator(task, strategy, run, progress);
             }});
      }
    }
  }
  const auto stopped = RunJobs(process, simulator_jobs, simulator);
  if (stopped && *stopped != 0) return *stopped;
  if (const auto status = RunJobs(process, robot_jobs, robot)) return *status;

  std::vector<Chart> charts;
  for (const PaperTask& task : kPaperTasks) {
    Chart errors{task.name,
                 "simulated steps",
                 fmt::format("error after {} steps, standard units", kHorizon),
                 true,
                 {}};
    Chart returns{task.name, "transitions of the robot", "return on the robot", false, {}};
    errors.logarithmic_x = returns.logarithmic_x = true;
    std::cout << fmt::format("{}, {} runs:\n  {:<40}{:>22}{:>22}{:>22}\n", task.name, options.runs,
                             "", "95 % of the oracle's",
                             fmt::format("error {} after {}", kTargets[0], kHorizon),
                             fmt::format("error {} after {}", kTargets[1], kHorizon));
    for (const CalibrationStrategy strategy : kStrategies) {
      errors.curves.push_back(CurveOf(options, task, strategy, simulator, true));
      returns.curves.push_back(CurveOf(options, task, strategy, robot, false));
      std::cout << fmt::format(
          "  {:<40}{:>22}", Label(strategy),
          Needed(returns.curves.back().x, Shares(options, task, strategy, robot),
                 [](double share) { return share >= kEnough; }));
      for (const double target : kTargets)
        std::cout << fmt::format("{:>22}",
                                 Needed(errors.curves.back().x, errors.curves.back().middle,
                                        [&](double error) { return error <= target; }));
      std::cout << "\n";
    }
    for (const CalibrationStrategy strategy :
         {CalibrationStrategy::kPrior, CalibrationStrategy::kOracle}) {
      const Band band = Bands(options, task, strategy, robot, false)[0];
      const std::vector<double>& x = returns.curves[0].x;
      returns.curves.push_back({Label(strategy), x, std::vector<double>(x.size(), band.middle),
                                std::vector<double>(x.size(), band.low),
                                std::vector<double>(x.size(), band.high)});
      errors.curves.push_back({Label(strategy), {}, {}, {}, {}});
      std::cout << fmt::format("  {:<40}return {:.0f}\n", Label(strategy), band.middle);
    }
    charts.push_back(std::move(returns));
    charts.push_back(std::move(errors));
  }
  WriteAtomically(
      folder / "sample_efficiency.svg",
      DrawCurves(
          fmt::format("what calibration costs, mean of {} runs and its 95 % band", options.runs),
          charts));
  return 0;
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  plumb::ExperimentOptions options;
  return plumb::Run(
      "plumb-sample-efficiency",
      "Transitions of the robot and simulated steps that each way of calibrating needs.", argc,
      argv,
      [&](CLI::App& app) {
        plumb::AddExperimentFlags(app, options, "the tables and sample_efficiency.svg");
        plumb::AddHiddenFlag(app, options.hidden);
        plumb::AddExamples(app, {"plumb-sample-efficiency robots --hidden prior --output figures"});
      },
      [&](plumb::Process& process) { return plumb::Measure(process, options); });
}
