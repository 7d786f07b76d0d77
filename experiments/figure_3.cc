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

#include <cmath>
#include <filesystem>
#include <iostream>

#include "common/atomic_file.h"
#include "experiments/recording.h"
#include "experiments/results.h"
#include "experiments/simulated_system.h"
#include "plot/curves.h"

namespace plumb {
namespace {

constexpr Way kWays[] = {Way::kOriginal, Way::kStep,    Way::kDefault,
                         Way::kPrior,    Way::kNominal, Way::kOracle};
constexpr double kRobotSeconds = 6;  // of an iteration: five of them are half a minute
constexpr double kEnough = 0.95;     // of the oracle's return

struct Options {
  std::string robots, output = ".";
  int runs = 5, iterations = 10, threads = 0;
  Hidden hidden = Hidden::kPaper;
  bool quick = false;
};

std::string KeyOf(const PaperTask& task, Way way, int run) {
  return fmt::format("{},{},{}", task.name, Key(way), run);
}

// The loop of a task and a run, which remembers the first policy.
struct Remembered {
  std::string of;
  std::unique_ptr<Loop> loop;
};

Results::Rows RunLoop(const Options& options, const PaperTask& task, Way way, int run,
                      Remembered& remembered, const std::function<void(double)>& progress) {
  const RobotDescription robot = LoadTask(options.robots, task);
  const auto seed = static_cast<uint64_t>(run);
  const Eigen::VectorXd hidden = DrawHidden(robot, options.hidden, seed);
  if (const std::string of = fmt::format("{} {}", task.name, run); remembered.of != of)
    remembered = {of, std::make_unique<Loop>(robot, hidden)};
  SimulatedSystem real(robot, hidden, ReadingNoise(robot), seed);
  LoopSettings settings;
  settings.way = way;
  settings.iterations = options.iterations;
  settings.steps_per_iteration = static_cast<int>(kRobotSeconds / robot.task.period);
  settings.first_updates = options.quick ? 2 : task.first_updates;
  settings.next_updates = options.quick ? 1 : task.next_updates;
  settings.evaluation_episodes = options.quick ? 2 : 20;
  settings.seed = seed;
  settings.threads = options.threads;
  Results::Rows rows;
  for (const LoopRow& row : remembered.loop->Run(real, settings, progress).rows) {
    const double error = std::sqrt((row.mean.array() / hidden.array() - 1).square().mean());
    rows.push_back({static_cast<double>(row.iteration), row.robot_return, row.simulated_return,
                    row.discrepancy, static_cast<double>(row.transitions), row.robot_seconds,
                    error});
  }
  return rows;
}

Panel Draw(const Options& options, const PaperTask& task, const Results& results) {
  Panel panel{
      task.name, "SimOpt iterations, 6 s of the robot each", "return on the robot", false, {}};
  for (const Way way : kWays) {
    Curve curve{Label(way), {}, {}, {}, {}};
    for (int k = 0; k <= options.iterations; ++k) {
      std::vector<double> returns;
      for (int run = 1; run <= options.runs; ++run)
        returns.push_back(results.Of(KeyOf(task, way, run))[static_cast<size_t>(k)][1]);
      const Band band = ConfidenceBand(returns, false);
      curve.x.push_back(k), curve.middle.push_back(band.middle), curve.low.push_back(band.low),
          curve.high.push_back(band.high);
    }
    panel.curves.push_back(std::move(curve));
  }
  return panel;
}

// After k iterations, of all runs; a return below zero is a cost, of which the oracle's is the
// least.
double ShareOfOracle(double value, double oracle) {
  return oracle > 0 ? value / oracle : oracle / value;
}

std::string Sentence(const Options& options, const PaperTask& task, const Results& results) {
  std::string text = fmt::format(
      "{}: return on the robot after 0, {}, {} iterations (mean of {} runs):", task.name,
      std::min(5, options.iterations), options.iterations, options.runs);
  const auto mean = [&](Way way, int k) {
    double sum = 0;
    for (int run = 1; run <= options.runs; ++run)
      sum += results.Of(KeyOf(task, way, run))[static_cast<size_t>(k)][1];
    return sum / options.runs;
  };
  for (const Way way : kWays) {
    text += fmt::format("\n  {:<40}{:8.0f}{:8.0f}{:8.0f}", Label(way), mean(way, 0),
                        mean(way, std::min(5, options.iterations)), mean(way, options.iterations));
  }
  for (const Way way : {Way::kOriginal, Way::kStep, Way::kDefault}) {
    int enough = options.iterations + 1;
    while (enough > 0 &&
           ShareOfOracle(mean(way, enough - 1), mean(Way::kOracle, enough - 1)) >= kEnough)
      --enough;
    text += fmt::format(
        "\n  {} has {:.0f} % of the oracle's return for good after so many iterations: {}",
        Label(way), 100 * kEnough,
        enough > options.iterations
            ? "never"
            : fmt::format("{} ({:.0f} s of the robot)", enough, enough * kRobotSeconds));
  }
  return text;
}

std::string SettingsOf(const Options& options) {
  return fmt::format("iterations {}, hidden {}{}", options.iterations, Key(options.hidden),
                     options.quick ? ", quick" : "");
}

int MakeFigure(Process& process, const Options& options) {
  const std::filesystem::path folder = options.output;
  Results results(folder / "figure_3.csv", SettingsOf(options), {"task", "way", "run"},
                  {"iteration", "robot_return", "simulated_return", "discrepancy", "transitions",
                   "robot_seconds", "parameter_error"});
  std::vector<Job> jobs;
  Remembered remembered;
  for (const PaperTask& task : kPaperTasks) {
    for (int run = 1; run <= options.runs; ++run) {
      for (const Way way : kWays) {
        const double weight =
            task.first_updates * (Learns(way) ? 0.5 : 1.0) + options.iterations * task.next_updates;
        jobs.push_back({KeyOf(task, way, run), weight, [&, run, way](const auto& progress) {
                          return RunLoop(options, task, way, run, remembered, progress);
                        }});
      }
    }
  }
  if (!RunJobs(process, jobs, results)) return 130;
  std::vector<Panel> panels;
  for (const PaperTask& task : kPaperTasks) {
    panels.push_back(Draw(options, task, results));
    std::cout << Sentence(options, task, results) << "\n";
  }
  WriteAtomically(folder / "figure_3.svg",
                  DrawCurves(fmt::format("return on the robot, mean of {} runs and its 95 % band",
                                         options.runs),
                             panels));
  return 0;
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  plumb::Options options;
  return plumb::Run(
      "plumb-figure-3",
      "Return on the robot over SimOpt's iterations, by each way of choosing simulators.", argc,
      argv,
      [&](CLI::App& app) {
        app.add_option("robots", options.robots, "the folder robots/")->required();
        app.add_option("--output", options.output, "folder for figure_3.csv and figure_3.svg")
            ->capture_default_str();
        app.add_option("--runs", options.runs, "seeds, and robots, from 1")
            ->check(CLI::Range(1, 1000))
            ->capture_default_str();
        app.add_option("--iterations", options.iterations, "of SimOpt")
            ->check(CLI::Range(1, 1000))
            ->capture_default_str();
        plumb::AddHiddenFlag(app, options.hidden);
        app.add_option("--threads", options.threads,
                       "0 = one per core; the result does not depend on it")
            ->check(CLI::Range(0, 1024));
        app.add_flag("--quick", options.quick, "hardly any training: looks whether it runs");
      },
      [&](plumb::Process& process) { return plumb::MakeFigure(process, options); });
}
