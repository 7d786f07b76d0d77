// A gap that is really there: the robot is none of the simulators, whatever their parameters.
//
//   hopper    MuJoCo's Hopper, with its own contact, stops and integrator
//   pendulum  Simbody's pendulum, with Coulomb friction, delay and backlash that the model does not
//             have
//
// Both are behind a CAN bus, with driver, observer and controller, in virtual time. Who still
// transfers, does the alarm speak, and does it help to let the engine fit friction, delay and
// contact?
//
//   plumb-reality-gap robots --output reality_gap
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iostream>

#include "calibrator/results/calibration.h"
#include "common/atomic_file.h"
#include "experiments/bus_robot.h"
#include "experiments/loop.h"
#include "experiments/options.h"
#include "experiments/results.h"
#include "plot/curves.h"
#include "sim/parameters.h"

namespace plumb {
namespace {

constexpr double kRobotSeconds = 6;  // of an iteration

struct Gap {
  const char *name, *title;
  // files below robots/: what is there, what is believed, what is believed with more to fit
  const char *truth, *model, *fitted;
};
constexpr Gap kGaps[] = {{"pendulum", "worn pendulum", "pendulum/worn.toml", "pendulum/robot.toml",
                          "pendulum/worn_fitted.toml"},
                         {"hopper", "MuJoCo's hopper", "hopper/mujoco.toml", "hopper/robot.toml",
                          "hopper/mujoco_fitted.toml"}};

struct Method {
  const char* key;
  std::string label;
  CalibrationStrategy strategy;
  bool fitted;
};
const std::array<Method, 7> kMethods{
    {{"original", Label(CalibrationStrategy::kOriginal), CalibrationStrategy::kOriginal, false},
     {"step", Label(CalibrationStrategy::kStep), CalibrationStrategy::kStep, false},
     {"default", Label(CalibrationStrategy::kDefault), CalibrationStrategy::kDefault, false},
     {"fitted", Label(CalibrationStrategy::kDefault) + ", more parameters",
      CalibrationStrategy::kDefault, true},
     {"prior", Label(CalibrationStrategy::kPrior), CalibrationStrategy::kPrior, false},
     {"nominal", Label(CalibrationStrategy::kNominal), CalibrationStrategy::kNominal, false},
     {"oracle", "the robot's masses, in the simulator", CalibrationStrategy::kOracle, false}}};

std::string KeyOf(const Gap& gap, const Method& method, int run) {
  return fmt::format("{},{},{}", gap.name, method.key, run);
}

std::filesystem::path AlarmFile(const ExperimentOptions& options, const Gap& gap,
                                const Method& method, int run) {
  return std::filesystem::path(options.output) /
         fmt::format("alarm_{}_{}_{}.txt", gap.name, method.key, run);
}

struct Remembered {
  std::string of;
  std::unique_ptr<Loop> loop;
};

Results::Rows RunLoop(const ExperimentOptions& options, const Gap& gap, const Method& method,
                      int run, Remembered& remembered,
                      const std::function<void(double)>& progress) {
  const auto load = [&](const char* file) {
    return LoadRobot((std::filesystem::path(options.robots) / file).string());
  };
  const RobotDescription truth = load(gap.truth),
                         model = load(method.fitted ? gap.fitted : gap.model);
  const auto seed = static_cast<uint64_t>(run);
  const Eigen::VectorXd hidden = HiddenParameters(truth, seed);
  if (const std::string of = fmt::format("{} {} {}", gap.name, method.fitted, run);
      remembered.of != of) {
    remembered = {of, std::make_unique<Loop>(model, hidden)};
  }
  BusRobot real(truth, model, hidden, seed);
  LoopSettings settings;
  settings.strategy = method.strategy;
  settings.iterations = options.iterations;
  settings.steps_per_iteration =
      static_cast<int>((options.quick ? 1 : kRobotSeconds) / model.task.period);
  settings.first_updates = options.quick ? 2 : model.training.updates;
  settings.next_updates = options.quick ? 1 : model.training.updates_again;
  settings.evaluation_episodes = options.quick ? 1 : 5;
  settings.seed = seed;
  settings.threads = options.threads;
  const LoopResult result = remembered.loop->Run(real, settings, progress);
  double alarm = std::nan("");
  if (method.strategy == CalibrationStrategy::kDefault) {
    CalibrationOptions calibration;
    calibration.seed = seed;
    calibration.execution = options.threads;
    const std::vector<Log> logs{{"roll-outs", result.rollouts, {}, {}}};
    const Misspecification found = Calibrate(model, logs, calibration).misspecification;
    alarm = found.alarm;
    WriteAtomically(AlarmFile(options, gap, method, run), found.summary + "\n");
  }
  Results::Rows rows;
  for (const LoopRow& row : result.rows) {
    rows.push_back({static_cast<double>(row.iteration), row.robot_return, row.simulated_return,
                    row.discrepancy, static_cast<double>(row.transitions), row.robot_seconds,
                    alarm});
  }
  return rows;
}

double Mean(const ExperimentOptions& options, const Gap& gap, const Method& method,
            const Results& results, int iteration, size_t column) {
  double sum = 0;
  for (int run = 1; run <= options.runs; ++run)
    sum += results.Of(KeyOf(gap, method, run))[static_cast<size_t>(iteration)][column];
  return sum / options.runs;
}

Panel Draw(const ExperimentOptions& options, const Gap& gap, const Results& results) {
  Panel panel{
      gap.title, "SimOpt iterations, 6 s of the robot each", "return on the robot", false, {}};
  for (const Method& method : kMethods) {
    Curve curve{method.label, {}, {}, {}, {}};
    for (int k = 0; k <= options.iterations; ++k) {
      std::vector<double> returns;
      for (int run = 1; run <= options.runs; ++run)
        returns.push_back(results.Of(KeyOf(gap, method, run))[static_cast<size_t>(k)][1]);
      const Band band = ConfidenceBand(returns, false);
      const auto [least, most] = std::minmax_element(returns.begin(), returns.end());
      curve.x.push_back(k), curve.middle.push_back(band.middle), curve.low.push_back(*least),
          curve.high.push_back(*most);
    }
    panel.curves.push_back(std::move(curve));
  }
  return panel;
}

std::string Sentence(const ExperimentOptions& options, const Gap& gap, const Results& results) {
  std::string text = fmt::format(
      "{}, {} runs: return on the robot before and after {} iterations, in simulation, "
      "discrepancy, alarms:",
      gap.title, options.runs, options.iterations);
  for (const Method& method : kMethods) {
    const auto mean = [&](int iteration, size_t column) {
      return Mean(options, gap, method, results, iteration, column);
    };
    text += fmt::format("\n  {:<42}{:8.0f}{:8.0f}{:8.0f}{:10.3g}", method.label, mean(0, 1),
                        mean(options.iterations, 1), mean(options.iterations, 2),
                        mean(options.iterations, 3));
    if (method.strategy != CalibrationStrategy::kDefault) continue;
    text += fmt::format("   {:.0f} of {}", options.runs * mean(0, 6), options.runs);
    std::ifstream file(AlarmFile(options, gap, method, 1));
    for (std::string line; std::getline(file, line);) text += "\n      " + line;
  }
  return text;
}

int Compare(Process& process, const ExperimentOptions& options) {
  const std::filesystem::path folder = options.output;
  Results results(
      folder / "reality_gap.csv",
      fmt::format("iterations {}{}", options.iterations, options.quick ? ", quick" : ""),
      {"gap", "method", "run"},
      {"iteration", "robot_return", "simulated_return", "discrepancy", "transitions",
       "robot_seconds", "alarm"});
  std::vector<Job> jobs;
  Remembered remembered;
  for (const Gap& gap : kGaps) {
    for (int run = 1; run <= options.runs; ++run) {
      for (const Method& method : kMethods) {
        jobs.push_back({KeyOf(gap, method, run), gap.name == std::string("hopper") ? 8.0 : 1.0,
                        [&, run](const auto& progress) {
                          return RunLoop(options, gap, method, run, remembered, progress);
                        }});
      }
    }
  }
  if (!RunJobs(process, jobs, results)) return 130;
  std::vector<Panel> panels;
  for (const Gap& gap : kGaps) {
    panels.push_back(Draw(options, gap, results));
    std::cout << Sentence(options, gap, results) << "\n";
  }
  WriteAtomically(folder / "reality_gap.svg",
                  DrawCurves(fmt::format("return on robots that no simulator is, mean of {} runs, "
                                         "band from the worst to the best",
                                         options.runs),
                             panels));
  return 0;
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  plumb::ExperimentOptions options;
  options.runs = 3, options.iterations = 5;
  return plumb::Run(
      "plumb-reality-gap", "Who transfers to a robot that is none of the simulators.", argc, argv,
      [&](CLI::App& app) {
        plumb::AddExperimentFlags(app, options,
                                  "reality_gap.csv, reality_gap.svg and what the alarms say");
        plumb::AddIterationsFlag(app, options.iterations);
      },
      [&](plumb::Process& process) { return plumb::Compare(process, options); });
}
