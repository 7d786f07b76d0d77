// A gap that is really there: robots that are none of the simulators, whatever their parameters,
// each behind a CAN bus with driver, observer and controller, in virtual time. Which ways of using
// six seconds of the robot an iteration end with a policy that works on it?
//
//   plumb-reality-gap robots --output reality_gap
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <map>

#include "common/atomic_file.h"
#include "common/examples.h"
#include "common/hash.h"
#include "common/median.h"
#include "common/special_numbers.h"
#include "experiments/bus_robot.h"
#include "experiments/bus_simulation.h"
#include "experiments/gap_comparison.h"
#include "experiments/jobs.h"
#include "experiments/loop.h"
#include "experiments/options.h"
#include "experiments/oracle.h"
#include "experiments/provenance.h"
#include "plot/curves.h"
#include "sim/parameters.h"

namespace plumb {
namespace {

constexpr double kRobotSeconds = 6;   // of an iteration
constexpr double kTrialShare = 0.75;  // of these, without exploration
constexpr int kJudged = 10;           // episodes

RobotDescription Load(const std::string& robots, const std::string& file) {
  return LoadRobot((std::filesystem::path(robots) / file).string());
}

// Whichever gaps are chosen: they share a table.
std::vector<RobotDescription> AllRobots(const std::string& robots) {
  std::vector<RobotDescription> all;
  for (const RealityGap& gap : kRealityGaps) {
    for (const char* file : {gap.truth, gap.model, gap.uncertain})
      all.push_back(Load(robots, file));
  }
  return all;
}

struct Options : ExperimentOptions {
  int first_run = 1;
  std::vector<std::string> gaps, methods;  // all if empty
};

template <class Item, size_t count>
std::vector<Item> Chosen(const std::array<Item, count>& all, const std::vector<std::string>& keys) {
  std::vector<Item> chosen;
  for (const Item& item : all) {
    if (keys.empty() || std::find(keys.begin(), keys.end(), item.key) != keys.end())
      chosen.push_back(item);
  }
  return chosen;
}

template <class Item, size_t count>
CLI::Validator OneOf(const std::array<Item, count>& all) {
  std::vector<std::string> keys;
  keys.reserve(count);
  for (const Item& item : all) keys.emplace_back(item.key);
  return CLI::IsMember(keys);
}

std::string KeyOf(const RealityGap& gap, const GapMethod& method, int run) {
  return fmt::format("{},{},{}", gap.key, method.key, run);
}

std::filesystem::path DecisionsFile(const Options& options, const RealityGap& gap,
                                    const GapMethod& method, int run) {
  return std::filesystem::path(options.output) /
         fmt::format("decisions_{}_{}_{}.txt", gap.key, method.key, run);
}

// The loops of a run, by model, which remember their first policies: gaps and methods share them.
struct Remembered {
  int run = 0;
  std::map<std::string, std::unique_ptr<Loop>> loops;
};

// The same policy in each iteration: it has no share in the loop.
Results::Rows RunOracle(const Options& options, const RealityGap& gap,
                        const RobotDescription& truth, const RobotDescription& model,
                        const Eigen::VectorXd& hidden, uint64_t seed, BusRobot& real,
                        const std::function<void(double)>& progress) {
  const std::filesystem::path checkpoint =
      std::filesystem::path(options.output) / fmt::format("oracle_{}_{}.checkpoint", gap.key, seed);
  const Oracle oracle = TrainOracle(
      model, SimulateBusRobot(truth, model, hidden, seed), seed, options.threads,
      checkpoint.string(), Hash(fmt::format("{} {}", Provenance({truth, model}), model.task.steps)),
      progress);
  const auto judged =
      Loop::Judge(real, oracle.policy, model.task.steps, options.quick ? 1 : kJudged);
  Results::Rows rows;
  for (int k = 0; k <= options.iterations; ++k) {
    rows.push_back({static_cast<double>(k), judged.mean, judged.worst, judged.mean, 0, judged.mean,
                    kNaN, 0, static_cast<double>(oracle.steps),
                    static_cast<double>(oracle.steps) * model.task.period});
  }
  return rows;
}

Results::Rows RunLoop(const Options& options, const RealityGap& gap, const GapMethod& method,
                      int run, Remembered& remembered,
                      const std::function<void(double)>& progress) {
  const char* model_file = method.uncertain ? gap.uncertain : gap.model;
  const RobotDescription truth = Load(options.robots, gap.truth);
  RobotDescription model = Load(options.robots, model_file);
  if (options.quick) model.task.steps = std::min(model.task.steps, 40);
  const auto seed = static_cast<uint64_t>(run);
  const Eigen::VectorXd hidden = HiddenParameters(truth, seed);
  if (remembered.run != run) remembered = {run, {}};
  std::unique_ptr<Loop>& loop = remembered.loops[model_file];
  if (!loop) loop = std::make_unique<Loop>(model, hidden);
  BusRobot real(truth, model, hidden, seed);
  if (method.oracle) return RunOracle(options, gap, truth, model, hidden, seed, real, progress);
  LoopSettings settings;
  settings.strategy = method.strategy;
  settings.iterations = options.iterations;
  settings.steps_per_iteration =
      static_cast<int>((options.quick ? 1 : kRobotSeconds) / model.task.period);
  settings.first_updates = options.quick ? 2 : model.training.first_updates();
  settings.next_updates = options.quick ? 1 : model.training.updates_again;
  settings.evaluation_episodes = options.quick ? 1 : kJudged;
  settings.trial_share = method.accept ? kTrialShare : 0;
  settings.accept = method.accept;
  settings.residual = method.residual;
  settings.forces = method.forces, settings.tempering = method.tempering;
  settings.seed = seed;
  settings.threads = options.threads;
  const LoopResult result = loop->Run(real, settings, progress);
  if (method.accept) {
    std::string text;
    for (const std::string& decision : result.decisions) text += decision + "\n";
    WriteAtomically(DecisionsFile(options, gap, method, run), text);
  }
  Results::Rows rows;
  for (const LoopRow& row : result.rows) {
    rows.push_back({static_cast<double>(row.iteration), row.robot_return, row.worst_return,
                    row.newest_return, static_cast<double>(row.deployed), row.simulated_return,
                    row.discrepancy, row.residual ? 1. : 0., static_cast<double>(row.transitions),
                    row.robot_seconds});
  }
  return rows;
}

constexpr size_t kReturn = 1, kNewest = 3, kResidual = 7;  // columns

std::vector<double> Column(const Options& options, const RealityGap& gap, const GapMethod& method,
                           const Results& results, int iteration, size_t column) {
  std::vector<double> values;
  for (int run = options.first_run; run < options.first_run + options.runs; ++run)
    values.push_back(results.Of(KeyOf(gap, method, run))[static_cast<size_t>(iteration)][column]);
  std::sort(values.begin(), values.end());
  return values;
}

// Of each iteration the median, and a band from the worst run to the best.
Curve CurveOf(const std::string& label, const Options& options, const RealityGap& gap,
              const GapMethod& method, const Results& results, size_t column) {
  Curve curve{label, {}, {}, {}, {}};
  for (int k = 0; k <= options.iterations; ++k) {
    const auto values = Column(options, gap, method, results, k, column);
    curve.x.push_back(k), curve.middle.push_back(Median(values)),
        curve.low.push_back(values.front()), curve.high.push_back(values.back());
  }
  return curve;
}

Chart Draw(const Options& options, const RealityGap& gap, const Results& results) {
  Chart chart{
      gap.title, "iterations, 6 s of the robot each", "return of the deployed policy", false, {}};
  const std::vector<GapMethod> methods = Chosen(kGapMethods, options.methods);
  for (const GapMethod& method : methods)
    chart.curves.push_back(CurveOf(method.label, options, gap, method, results, kReturn));
  if (methods.size() == 1 && methods[0].accept)
    chart.curves.push_back(
        CurveOf("the newest policy", options, gap, methods[0], results, kNewest));
  return chart;
}

std::string Table(const Options& options, const RealityGap& gap, const Results& results) {
  std::string text = fmt::format(
      "{}, {} runs: return of the deployed policy, median (worst), after 0, 1, ... iterations; "
      "runs with a residual:",
      gap.title, options.runs);
  for (const GapMethod& method : Chosen(kGapMethods, options.methods)) {
    text += fmt::format("\n  {:<36}", method.label);
    for (int k = 0; k <= options.iterations; ++k) {
      const auto returns = Column(options, gap, method, results, k, kReturn);
      text += fmt::format("{:>14}", fmt::format("{:.0f} ({:.0f})", Median(returns), returns[0]));
    }
    const auto with = Column(options, gap, method, results, options.iterations, kResidual);
    if (method.residual)
      text += fmt::format("  {} of {}", std::count(with.begin(), with.end(), 1.), options.runs);
  }
  return text;
}

int Compare(Process& process, const Options& options) {
  const std::filesystem::path folder = options.output;
  const Ranks ranks;
  Results results(
      folder / "reality_gap.csv",
      fmt::format("iterations {}{}, {}", options.iterations, options.quick ? ", quick" : "",
                  Provenance(AllRobots(options.robots))),
      {"gap", "method", "run"},
      {"iteration", "robot_return", "worst_episode", "newest_return", "deployed",
       "simulated_return", "discrepancy", "residual", "transitions", "robot_seconds"},
      ranks);
  const std::vector<RealityGap> gaps = Chosen(kRealityGaps, options.gaps);
  std::vector<Job> jobs;
  Remembered remembered;
  for (int run = options.first_run; run < options.first_run + options.runs; ++run) {
    for (const GapMethod& method : Chosen(kGapMethods, options.methods)) {
      for (const RealityGap& gap : gaps) {
        const bool hopper = std::string(gap.model).starts_with("hopper");
        jobs.push_back({KeyOf(gap, method, run), hopper ? 8.0 : 1.0, run,
                        [&, run, gap, method](const auto& progress) {
                          return RunLoop(options, gap, method, run, remembered, progress);
                        }});
      }
    }
  }
  if (const auto status = RunJobs(process, jobs, results)) return *status;
  std::vector<Chart> charts;
  for (const RealityGap& gap : gaps) {
    charts.push_back(Draw(options, gap, results));
    std::cout << Table(options, gap, results) << "\n";
  }
  WriteAtomically(folder / "reality_gap.svg",
                  DrawCurves(fmt::format("return on robots that no simulator is, median of {} "
                                         "runs, band from the worst to the best",
                                         options.runs),
                             charts));
  return 0;
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  plumb::Options options;
  options.runs = 5, options.iterations = 5;
  return plumb::Run(
      "plumb-reality-gap", "What transfers to robots that are none of the simulators.", argc, argv,
      [&](CLI::App& app) {
        plumb::AddExperimentFlags(app, options,
                                  "reality_gap.csv, reality_gap.svg and what was deployed, why");
        plumb::AddIterationsFlag(app, options.iterations);
        plumb::AddCountFlag(app, "--first-run", options.first_run, "the first of the seeds");
        app.add_option("--gaps", options.gaps, "some of the robots, by their keys")
            ->check(plumb::OneOf(plumb::kRealityGaps))
            ->delimiter(',');
        app.add_option("--methods", options.methods, "some of the methods, by their keys")
            ->check(plumb::OneOf(plumb::kGapMethods))
            ->delimiter(',');
        plumb::AddExamples(
            app,
            {"plumb-reality-gap robots --gaps hopper,stiff --methods default,oracle --runs 1"});
      },
      [&](plumb::Process& process) { return plumb::Compare(process, options); });
}
