// Figure 2: how far calibrated simulators are from the "real" robot after n steps, step-based
// against original SimOpt.
//
// For each run the robot is the simulator itself (gym's Pendulum and Hopper) with parameters drawn
// anew, its states read with noise. A policy trained on the prior moves it. The two SimOpts see the
// same roll-outs, one an iteration, and simulate the same number of steps: 25 simulators, one
// update an iteration. Plumbline's default gets as many transitions of the same roll-outs as it can
// fit within the same number of simulated steps, and within a hundredth of it; where that is not
// enough for a fit, within twice as many, and so on. Other roll-outs of the same policy judge.
//
//   plumb-figure-2 robots --output figure_2
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <filesystem>
#include <iostream>

#include "calibrator/live/calibrator.h"
#include "common/atomic_file.h"
#include "common/examples.h"
#include "experiments/budget.h"
#include "experiments/jobs.h"
#include "experiments/n_step_error.h"
#include "experiments/options.h"
#include "experiments/provenance.h"
#include "experiments/recording.h"
#include "plot/curves.h"

namespace plumb {
namespace {

constexpr int kHorizon = 50, kSimulators = 20;

struct Method {
  const char* key;
  std::string label;
  CalibrationStrategy strategy;
  int64_t share;  // 1/share of the budget
};
const std::vector<Method> kMethods{
    {"original", Label(CalibrationStrategy::kOriginal), CalibrationStrategy::kOriginal, 1},
    {"step", Label(CalibrationStrategy::kStep), CalibrationStrategy::kStep, 1},
    {"default", Label(CalibrationStrategy::kDefault) + ", same budget",
     CalibrationStrategy::kDefault, 1},
    {"default-few", Label(CalibrationStrategy::kDefault) + ", few steps",
     CalibrationStrategy::kDefault, 100},
    {"prior", "the prior", CalibrationStrategy::kPrior, 1}};

struct Options : ExperimentOptions {
  double noise = 1;
};

std::string KeyOf(const PaperTask& task, const Method& method, int run) {
  return fmt::format("{},{},{}", task.name, method.key, run);
}

// The data that all methods of a run share.
struct Remembered {
  std::string of;
  RobotDataset recording;
  int64_t budget = 0;  // simulated steps
};

Remembered RecordRun(const Options& options, const PaperTask& task, int run,
                     const std::function<void(double)>& progress) {
  const RobotDescription robot = LoadTask(options.robots, task, options.hidden);
  const int updates = options.quick ? 40 : robot.training.first_updates();
  const RecordingSettings settings{updates,        options.iterations,         options.noise,
                                   options.hidden, static_cast<uint64_t>(run), options.threads};
  Remembered remembered{fmt::format("{} {}", task.name, run), Record(robot, settings, progress)};
  remembered.budget = 25 * static_cast<int64_t>(CountTransitions(remembered.recording.seen));
  return remembered;
}

// Twice as much as long as the budget is not enough for any fit.
BudgetedFit FitFrom(const Options& options, const Remembered& remembered, int64_t budget,
                    uint64_t seed) {
  for (;; budget *= 2) {
    try {
      return FitWithin(remembered.recording.robot, remembered.recording.seen, budget, seed,
                       options.threads);
    } catch (const std::invalid_argument&) {
      if (budget >= remembered.budget) throw;
    }
  }
}

Results::Rows Measure(const Options& options, const Remembered& remembered, const Method& method,
                      int run) {
  const auto seed = static_cast<uint64_t>(run);
  const RobotDescription& robot = remembered.recording.robot;
  ParameterDistribution distribution = ParameterDistribution::Prior(robot);
  int64_t simulated = 0;
  if (method.strategy == CalibrationStrategy::kDefault) {
    const BudgetedFit fit = FitFrom(options, remembered, remembered.budget / method.share, seed);
    distribution = fit.distribution, simulated = fit.simulated_steps;
  } else if (Learns(method.strategy)) {
    const auto simopt = MakeSimOpt(method.strategy, robot, seed, options.threads);
    for (const Rollout& rollout : remembered.recording.seen) {
      simopt->Begin({rollout});
      simopt->Update();
    }
    distribution = DistributionOf(robot, simopt->state()), simulated = remembered.budget;
  }
  const Eigen::VectorXd errors = NStepErrors(robot, distribution, remembered.recording.held_out,
                                             kHorizon, kSimulators, 10, seed);
  Results::Rows rows;
  for (int n = 1; n <= kHorizon; ++n)
    rows.push_back({static_cast<double>(n), errors(n - 1), static_cast<double>(simulated)});
  return rows;
}

Chart Draw(const Options& options, const PaperTask& task, const Results& results) {
  Chart chart{task.name, "n, control steps", "error after n steps, standard units", true, {}};
  for (const Method& method : kMethods) {
    Curve curve{method.label, {}, {}, {}, {}};
    for (size_t n = 0; n < kHorizon; ++n) {
      std::vector<double> errors;
      for (int run = 1; run <= options.runs; ++run)
        errors.push_back(results.Of(KeyOf(task, method, run))[n][1]);
      const Band band = ConfidenceBand(errors, true);
      curve.x.push_back(static_cast<double>(n + 1)), curve.middle.push_back(band.middle),
          curve.low.push_back(band.low), curve.high.push_back(band.high);
    }
    chart.curves.push_back(std::move(curve));
  }
  return chart;
}

// How many of n = 1 ... 20 have the first curve below the second, and its band below the other's.
std::string Below(const Chart& chart, size_t first, size_t second) {
  constexpr size_t kJudged = 20;
  int below = 0, apart = 0;
  for (size_t n = 0; n < kJudged; ++n) {
    below += chart.curves[first].middle[n] < chart.curves[second].middle[n];
    apart += chart.curves[first].high[n] < chart.curves[second].low[n];
  }
  return fmt::format("at {} of n = 1 ... {}, bands apart at {}", below, kJudged, apart);
}

std::string Sentence(const Options& options, const PaperTask& task, const Chart& chart,
                     const Results& results) {
  std::string text = fmt::format(
      "{}, {} runs, error after 1, 10, 20, 50 steps, simulated steps:", task.name, options.runs);
  for (size_t m = 0; m < kMethods.size(); ++m) {
    double simulated = 0;
    for (int run = 1; run <= options.runs; ++run)
      simulated += results.Of(KeyOf(task, kMethods[m], run))[0][2] / options.runs;
    const auto& middle = chart.curves[m].middle;
    text += fmt::format("\n  {:<42}{:10.2g}{:10.2g}{:10.2g}{:10.2g}{:12.0f}", kMethods[m].label,
                        middle[0], middle[9], middle[19], middle[49], simulated);
  }
  text += fmt::format(
      "\n  step-based below original {}; default with few below step-based {}, below "
      "original {}",
      Below(chart, 1, 0), Below(chart, 3, 1), Below(chart, 3, 0));
  return text;
}

std::string SettingsOf(const Options& options) {
  return fmt::format("iterations {}, noise {}, drawn from {}{}, {}", options.iterations,
                     options.noise, Key(options.hidden), options.quick ? ", quick" : "",
                     Provenance(LoadTasks(options.robots, options.hidden)));
}

int MakeFigure(Process& process, const Options& options) {
  const std::filesystem::path folder = options.output;
  const Ranks ranks;
  Results results(folder / "figure_2.csv", SettingsOf(options), {"task", "method", "run"},
                  {"n", "error", "simulated_steps"}, ranks);
  std::vector<Job> jobs;
  Remembered remembered;
  for (const PaperTask& task : kPaperTasks) {
    for (int run = 1; run <= options.runs; ++run) {
      for (const Method& method : kMethods) {
        jobs.push_back({KeyOf(task, method, run), 1, run, [&, run](const auto& progress) {
                          if (remembered.of != fmt::format("{} {}", task.name, run))
                            remembered = RecordRun(options, task, run, progress);
                          return Measure(options, remembered, method, run);
                        }});
      }
    }
  }
  if (const auto status = RunJobs(process, jobs, results)) return *status;
  std::vector<Chart> charts;
  for (const PaperTask& task : kPaperTasks) {
    charts.push_back(Draw(options, task, results));
    std::cout << Sentence(options, task, charts.back(), results) << "\n";
  }
  WriteAtomically(
      folder / "figure_2.svg",
      DrawCurves(fmt::format("error of simulators after n steps, mean of {} runs and its 95 % band",
                             options.runs),
                 charts));
  return 0;
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  plumb::Options options;
  options.iterations = 40;
  return plumb::Run(
      "plumb-figure-2",
      "How far calibrated simulators are from a robot after n steps, by each way of calibrating.",
      argc, argv,
      [&](CLI::App& app) {
        plumb::AddExperimentFlags(app, options, "figure_2.csv and figure_2.svg");
        plumb::AddIterationsFlag(app, options.iterations, "roll-outs, and updates of both SimOpts");
        plumb::AddHiddenFlag(app, options.hidden);
        app.add_option("--noise", options.noise, "of the readings: a factor; the paper's are exact")
            ->check(CLI::PositiveNumber)
            ->capture_default_str();
        plumb::AddExamples(app, {"plumb-figure-2 robots --hidden gym --output figures"});
      },
      [&](plumb::Process& process) { return plumb::MakeFigure(process, options); });
}
