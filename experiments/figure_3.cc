// Figure 3: the return on the "real" robot over SimOpt's iterations, by each way of choosing
// simulators.
//
// The robot is the simulator itself (gym's Pendulum and Hopper) with parameters drawn for each run;
// its states are read with noise. All ways have the same seeds and make the same number of TRPO
// updates; those that learn have the same seconds of the robot.
//
//   plumb-figure-3 robots --output figure_3
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <numeric>
#include <set>

#include "common/atomic_file.h"
#include "common/examples.h"
#include "common/median.h"
#include "experiments/jobs.h"
#include "experiments/options.h"
#include "experiments/oracle.h"
#include "experiments/provenance.h"
#include "experiments/recording.h"
#include "experiments/simulated_system.h"
#include "plot/curves.h"

namespace plumb {
namespace {

constexpr CalibrationStrategy kStrategies[] = {
    CalibrationStrategy::kOriginal, CalibrationStrategy::kStep,    CalibrationStrategy::kDefault,
    CalibrationStrategy::kPrior,    CalibrationStrategy::kNominal, CalibrationStrategy::kOracle};
constexpr double kRobotSeconds = 6;  // of an iteration: five of them are half a minute
constexpr double kEnough = 0.95;     // of the oracle's return

std::string KeyOf(const PaperTask& task, CalibrationStrategy strategy, int run) {
  return fmt::format("{},{},{}", task.name, Key(strategy), run);
}

// The loop of a task and a run, which remembers the first policy.
struct Remembered {
  std::string of;
  std::unique_ptr<Loop> loop;
};

Results::Rows RunLoop(const ExperimentOptions& options, const PaperTask& task,
                      CalibrationStrategy strategy, int run, Remembered& remembered,
                      const std::function<void(double)>& progress) {
  const RobotDescription robot = LoadTask(options.robots, task, options.hidden);
  const auto seed = static_cast<uint64_t>(run);
  const Eigen::VectorXd hidden = DrawHidden(robot, options.hidden, seed);
  if (const std::string of = fmt::format("{} {}", task.name, run); remembered.of != of)
    remembered = {of, std::make_unique<Loop>(robot, hidden)};
  SimulatedSystem real(robot, hidden, ReadingNoise(robot), seed);
  LoopSettings settings;
  settings.strategy = strategy;
  settings.iterations = options.iterations;
  settings.steps_per_iteration = static_cast<int>(kRobotSeconds / robot.task.period);
  settings.first_updates = options.quick ? 2 : robot.training.first_updates();
  settings.next_updates = options.quick ? 1 : robot.training.updates_again;
  settings.evaluation_episodes = options.quick ? 2 : 20;
  settings.seed = seed;
  settings.threads = options.threads;
  Results::Rows rows;
  for (const LoopRow& row : remembered.loop->Run(real, settings, progress).rows) {
    rows.push_back({static_cast<double>(row.iteration), row.robot_return, row.simulated_return,
                    row.discrepancy, static_cast<double>(row.transitions), row.robot_seconds,
                    RelativeError(robot, row.mean, hidden)});
  }
  return rows;
}

Chart Draw(const ExperimentOptions& options, const PaperTask& task, const Results& results) {
  Chart chart{
      task.name, "SimOpt iterations, 6 s of the robot each", "return on the robot", false, {}};
  for (const CalibrationStrategy strategy : kStrategies) {
    Curve curve{Label(strategy), {}, {}, {}, {}};
    for (int k = 0; k <= options.iterations; ++k) {
      std::vector<double> returns;
      for (int run = 1; run <= options.runs; ++run)
        returns.push_back(results.Of(KeyOf(task, strategy, run))[static_cast<size_t>(k)][1]);
      const Band band = ConfidenceBand(returns, false);
      curve.x.push_back(k), curve.middle.push_back(band.middle), curve.low.push_back(band.low),
          curve.high.push_back(band.high);
    }
    chart.curves.push_back(std::move(curve));
  }
  return chart;
}

// One column of the table after k iterations, of all runs.
std::vector<double> Column(const ExperimentOptions& options, const PaperTask& task,
                           CalibrationStrategy strategy, const Results& results, int k,
                           size_t column) {
  std::vector<double> values;
  for (int run = 1; run <= options.runs; ++run)
    values.push_back(results.Of(KeyOf(task, strategy, run))[static_cast<size_t>(k)][column]);
  return values;
}

double Mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

std::string Sentence(const ExperimentOptions& options, const PaperTask& task,
                     const Results& results) {
  constexpr size_t kReturn = 1, kError = 6;
  const std::set<int> shown{0, std::min(1, options.iterations), std::min(5, options.iterations),
                            options.iterations};
  std::string text = fmt::format(
      "{}: return on the robot, mean (median, worst) of {} runs, after so many iterations; by how "
      "much the parameters are wrong in the end, mean:\n{:40}",
      task.name, options.runs, "");
  for (const int k : shown) text += fmt::format("{:>22}", k);
  const auto mean = [&](CalibrationStrategy strategy, int k) {
    return Mean(Column(options, task, strategy, results, k, kReturn));
  };
  for (const CalibrationStrategy strategy : kStrategies) {
    text += fmt::format("\n  {:<38}", Label(strategy));
    for (const int k : shown) {
      const std::vector<double> values = Column(options, task, strategy, results, k, kReturn);
      text += fmt::format("{:>22}", fmt::format("{:.0f} ({:.0f}, {:.0f})", Mean(values),
                                                Median(values), *std::ranges::min_element(values)));
    }
    if (Learns(strategy)) {
      text += fmt::format("{:>9.2g} %", 100 * Mean(Column(options, task, strategy, results,
                                                          options.iterations, kError)));
    }
  }
  for (const CalibrationStrategy strategy :
       {CalibrationStrategy::kOriginal, CalibrationStrategy::kStep,
        CalibrationStrategy::kDefault}) {
    int enough = options.iterations + 1;
    while (enough > 0 && ShareOfOracle(mean(strategy, enough - 1),
                                       mean(CalibrationStrategy::kOracle, enough - 1)) >= kEnough)
      --enough;
    text += fmt::format(
        "\n  {} has {:.0f} % of the oracle's return for good after so many iterations: {}",
        Label(strategy), 100 * kEnough,
        enough > options.iterations
            ? "never"
            : fmt::format("{} ({:.0f} s of the robot)", enough, enough * kRobotSeconds));
  }
  return text;
}

std::string SettingsOf(const ExperimentOptions& options) {
  return fmt::format("iterations {}, drawn from {}{}, {}", options.iterations, Key(options.hidden),
                     options.quick ? ", quick" : "",
                     Provenance(LoadTasks(options.robots, options.hidden)));
}

int MakeFigure(Process& process, const ExperimentOptions& options) {
  const std::filesystem::path folder = options.output;
  const Ranks ranks;
  Results results(folder / "figure_3.csv", SettingsOf(options), {"task", "way", "run"},
                  {"iteration", "robot_return", "simulated_return", "discrepancy", "transitions",
                   "robot_seconds", "parameter_error"},
                  ranks);
  std::vector<Job> jobs;
  Remembered remembered;
  for (const PaperTask& task : kPaperTasks) {
    const TrainingSettings training = LoadTask(options.robots, task, options.hidden).training;
    for (int run = 1; run <= options.runs; ++run) {
      for (const CalibrationStrategy strategy : kStrategies) {
        const double weight =
            training.batch * (training.first_updates() * (Learns(strategy) ? 0.5 : 1.0) +
                              options.iterations * training.updates_again);
        jobs.push_back(
            {KeyOf(task, strategy, run), weight, run, [&, run, strategy](const auto& progress) {
               return RunLoop(options, task, strategy, run, remembered, progress);
             }});
      }
    }
  }
  if (const auto status = RunJobs(process, jobs, results)) return *status;
  std::vector<Chart> charts;
  for (const PaperTask& task : kPaperTasks) {
    charts.push_back(Draw(options, task, results));
    std::cout << Sentence(options, task, results) << "\n";
  }
  WriteAtomically(folder / "figure_3.svg",
                  DrawCurves(fmt::format("return on the robot, mean of {} runs and its 95 % band",
                                         options.runs),
                             charts));
  return 0;
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  plumb::ExperimentOptions options;
  return plumb::Run(
      "plumb-figure-3",
      "Return on the robot over SimOpt's iterations, by each way of choosing simulators.", argc,
      argv,
      [&](CLI::App& app) {
        plumb::AddExperimentFlags(app, options, "figure_3.csv and figure_3.svg");
        plumb::AddIterationsFlag(app, options.iterations);
        plumb::AddHiddenFlag(app, options.hidden);
        plumb::AddExamples(app, {"plumb-figure-3 robots --runs 2 --output figures"});
      },
      [&](plumb::Process& process) { return plumb::MakeFigure(process, options); });
}
