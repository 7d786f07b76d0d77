// Step-based against trajectory-based SimOpt on recorded roll-outs. The two use the same roll-outs,
// samples, updates, KL bound and REPS, hence the same number of simulated transitions: the newest
// roll-out's, for each sample of each update. Plumbline's own objective (the posterior) uses all
// roll-outs so far, and is shown beside them with its greater number. For each run folder of `plumb
// launch` all roll-outs but the last two calibrate, one an iteration; the last two judge.
//
//   plumb-step-vs-trajectory robots/pendulum runs/a runs/b ... --csv table.csv

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <iostream>

#include "calibrator/live/checkpoint.h"
#include "calibrator/live/simopt.h"
#include "common/atomic_file.h"
#include "common/examples.h"
#include "common/process.h"
#include "experiments/options.h"

namespace plumb {
namespace {

constexpr size_t kHeldOut = 2;

struct Method {
  const char* name;
  Objective objective;
  bool prior;  // no calibration at all
};
constexpr Method kMethods[] = {{"prior", Objective::kStep, true},
                               {"trajectory-based (SimOpt eq. 5)", Objective::kTrajectory, false},
                               {"step-based (paper's cost)", Objective::kStep, false},
                               {"step-based, posterior", Objective::kPosterior, false}};

struct Judgement {
  // root mean square prediction errors on the held-out roll-outs, one per horizon
  Eigen::VectorXd errors;
  size_t transitions = 0;  // simulated for it
};

Judgement Judge(const RobotDescription& robot, const std::vector<Rollout>& rollouts,
                const Method& method, uint64_t seed) {
  Judgement judgement;
  SimOpt simopt(robot, seed, 2, method.objective);
  const size_t training = rollouts.size() - kHeldOut;
  for (size_t i = 0; i < training && !method.prior; ++i) {
    const auto used = std::span(rollouts).first(i + 1).last(
        method.objective == Objective::kPosterior ? i + 1 : 1);
    judgement.transitions += CountTransitions(used) *
                             static_cast<size_t>(robot.calibration.samples) *
                             static_cast<size_t>(robot.calibration.updates);
    simopt.Begin({rollouts[i]});
    while (!simopt.Update()) {
    }
  }
  const Eigen::VectorXd physical = robot.ToPhysical(Moments(simopt.state().distribution).mean);
  Discrepancy discrepancy(robot);
  const auto held_out = std::span(rollouts).last(kHeldOut);
  judgement.errors.resize(static_cast<Eigen::Index>(robot.calibration.horizons.size()));
  for (Eigen::Index h = 0; h < judgement.errors.size(); ++h) {
    judgement.errors(h) = discrepancy.PredictionError(
        physical, held_out, robot.calibration.horizons[static_cast<size_t>(h)])(0);
  }
  return judgement;
}

int Compare(const std::string& robot_path, const std::vector<std::string>& folders, int seeds,
            const std::string& csv) {
  const RobotDescription robot = LoadRobot(robot_path);
  if (!csv.empty()) RequireWritable(csv);
  std::string table = "method,run,seed,transitions";
  std::cout << fmt::format("{:<34}", "root mean square error, held out");
  for (const int n : robot.calibration.horizons) {
    table += fmt::format(",error_{}", n);
    std::cout << fmt::format("{:>12}", fmt::format("{}-step", n));
  }
  table += "\n";
  std::cout << fmt::format("{:>24}", "transitions simulated") << std::endl;
  for (const Method& method : kMethods) {
    Eigen::VectorXd squared =
        Eigen::VectorXd::Zero(static_cast<Eigen::Index>(robot.calibration.horizons.size()));
    int count = 0;
    size_t transitions = 0;
    for (const std::string& folder : folders) {
      const std::vector<Rollout> rollouts =
          LoadRollouts(std::filesystem::path(folder) / "calibration", robot);
      if (rollouts.size() <= kHeldOut)
        throw std::runtime_error(folder + ": holds too few roll-outs");
      for (int seed = 1; seed <= (method.prior ? 1 : seeds); ++seed) {
        const Judgement judgement = Judge(robot, rollouts, method, static_cast<uint64_t>(seed));
        squared += judgement.errors.cwiseAbs2();
        transitions += judgement.transitions;
        ++count;
        table += fmt::format("{},{},{},{}", method.name, folder, seed, judgement.transitions);
        for (const double error : judgement.errors) table += fmt::format(",{:g}", error);
        table += "\n";
      }
    }
    std::cout << fmt::format("{:<34}", method.name);
    for (const double x : squared) std::cout << fmt::format("{:12.5f}", std::sqrt(x / count));
    std::cout << fmt::format("{:24}", transitions / static_cast<size_t>(count)) << std::endl;
  }
  if (!csv.empty()) WriteAtomically(csv, table);
  return 0;
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  std::string robot, csv;
  std::vector<std::string> folders;
  int seeds = 3;
  return plumb::Run(
      "plumb-step-vs-trajectory",
      "Compares step-based with trajectory-based SimOpt on recorded roll-outs.", argc, argv,
      [&](CLI::App& app) {
        app.add_option("robot", robot, "robot folder or TOML file")->required();
        app.add_option("runs", folders, "output folders of plumb launch")->required();
        plumb::AddCountFlag(app, "--seeds", seeds, "of the calibration, per run");
        app.add_option("--csv", csv, "write every single result here");
        plumb::AddExamples(app, {"plumb-step-vs-trajectory robots/pendulum runs/1 runs/2"});
      },
      [&](plumb::Process& process) {
        process.EndAtOnce();  // nothing is half written
        return plumb::Compare(robot, folders, seeds, csv);
      });
}
