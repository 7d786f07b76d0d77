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
#include "experiments/calibration_cost.h"
#include "experiments/jobs.h"
#include "experiments/options.h"
#include "experiments/oracle.h"
#include "experiments/provenance.h"
#include "plot/curves.h"

namespace plumb {
namespace {

constexpr CalibrationStrategy kStrategies[] = {
    CalibrationStrategy::kOriginal, CalibrationStrategy::kStep, CalibrationStrategy::kDefault};
// The same for any number of transitions.
constexpr CalibrationStrategy kReferences[] = {CalibrationStrategy::kPrior,
                                               CalibrationStrategy::kOracle};
constexpr double kEnough = 0.95;  // of the oracle's return
constexpr int kHorizon = CalibrationCost::kHorizon;
constexpr double kTargets[] = {0.01, 0.001};  // errors after kHorizon steps, standard units

std::string KeyOf(const PaperTask& task, CalibrationStrategy strategy, int run) {
  return fmt::format("{},{},{}", task.name, Key(strategy), run);
}

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

struct Jobs {
  std::vector<Job> robot, simulator;
};

Jobs JobsOf(const ExperimentOptions& options, CalibrationCost& cost) {
  Jobs jobs;
  for (const PaperTask& task : kPaperTasks) {
    const TrainingSettings training = LoadTask(options.robots, task, options.hidden).training;
    for (int run = 1; run <= options.runs; ++run) {
      for (const CalibrationStrategy strategy :
           {CalibrationStrategy::kOriginal, CalibrationStrategy::kStep,
            CalibrationStrategy::kDefault, CalibrationStrategy::kPrior,
            CalibrationStrategy::kOracle}) {
        const double weight =
            Learns(strategy) ? static_cast<double>(TransitionCounts(options).size()) : 1;
        jobs.robot.push_back({KeyOf(task, strategy, run),
                              weight * training.batch * training.updates_again, run,
                              [&cost, &task, strategy, run](const auto& progress) {
                                return cost.Returns(task, strategy, run, progress);
                              }});
        if (!Learns(strategy)) continue;
        jobs.simulator.push_back({KeyOf(task, strategy, run), 1, run,
                                  [&cost, &task, strategy, run](const auto& progress) {
                                    return cost.Errors(task, strategy, run, progress);
                                  }});
      }
    }
  }
  return jobs;
}

struct Charts {
  Chart returns, errors;
};

Charts ChartsOf(const ExperimentOptions& options, const PaperTask& task, const Results& robot,
                const Results& simulator) {
  Chart returns{task.name, "transitions of the robot", "return on the robot", false, {}};
  Chart errors{task.name,
               "simulated steps",
               fmt::format("error after {} steps, standard units", kHorizon),
               true,
               {}};
  errors.logarithmic_x = returns.logarithmic_x = true;
  for (const CalibrationStrategy strategy : kStrategies) {
    returns.curves.push_back(CurveOf(options, task, strategy, robot, false));
    errors.curves.push_back(CurveOf(options, task, strategy, simulator, true));
  }
  for (const CalibrationStrategy strategy : kReferences) {
    const Band band = Bands(options, task, strategy, robot, false)[0];
    const std::vector<double>& x = returns.curves[0].x;
    returns.curves.push_back({Label(strategy), x, std::vector<double>(x.size(), band.middle),
                              std::vector<double>(x.size(), band.low),
                              std::vector<double>(x.size(), band.high)});
    errors.curves.push_back({Label(strategy), {}, {}, {}, {}});
  }
  return {std::move(returns), std::move(errors)};
}

std::string TableOf(const ExperimentOptions& options, const PaperTask& task, const Charts& charts,
                    const Results& robot) {
  std::string text =
      fmt::format("{}, {} runs:\n  {:<40}{:>22}{:>22}{:>22}\n", task.name, options.runs, "",
                  "95 % of the oracle's", fmt::format("error {} after {}", kTargets[0], kHorizon),
                  fmt::format("error {} after {}", kTargets[1], kHorizon));
  for (size_t i = 0; i < std::size(kStrategies); ++i) {
    const CalibrationStrategy strategy = kStrategies[i];
    const Curve &returns = charts.returns.curves[i], &errors = charts.errors.curves[i];
    text += fmt::format("  {:<40}{:>22}", Label(strategy),
                        Needed(returns.x, Shares(options, task, strategy, robot),
                               [](double share) { return share >= kEnough; }));
    for (const double target : kTargets)
      text += fmt::format(
          "{:>22}", Needed(errors.x, errors.middle, [&](double error) { return error <= target; }));
    text += "\n";
  }
  for (const CalibrationStrategy strategy : kReferences) {
    text += fmt::format("  {:<40}return {:.0f}\n", Label(strategy),
                        Bands(options, task, strategy, robot, false)[0].middle);
  }
  return text;
}

int Measure(Process& process, const ExperimentOptions& options) {
  const std::filesystem::path folder = options.output;
  const Ranks ranks;
  Results robot(folder / "sample_efficiency_robot.csv", SettingsOf(options), {"task", "way", "run"},
                {"transitions", "robot_return"}, ranks);
  Results simulator(folder / "sample_efficiency_simulator.csv", SettingsOf(options),
                    {"task", "way", "run"}, {"simulated_steps", "error"}, ranks);
  CalibrationCost cost(options);
  const Jobs jobs = JobsOf(options, cost);
  const auto stopped = RunJobs(process, jobs.simulator, simulator);
  if (stopped && *stopped != 0) return *stopped;
  if (const auto status = RunJobs(process, jobs.robot, robot)) return *status;

  std::vector<Chart> all;
  for (const PaperTask& task : kPaperTasks) {
    const Charts charts = ChartsOf(options, task, robot, simulator);
    std::cout << TableOf(options, task, charts, robot);
    all.insert(all.end(), {charts.returns, charts.errors});
  }
  WriteAtomically(
      folder / "sample_efficiency.svg",
      DrawCurves(
          fmt::format("what calibration costs, mean of {} runs and its 95 % band", options.runs),
          all));
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
