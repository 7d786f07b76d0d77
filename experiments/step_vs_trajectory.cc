// Step-based against trajectory-based SimOpt on recorded roll-outs, with the same budget: the same number of
// simulated transitions, samples, updates and KL bound, the same REPS. For each run folder of `plumb launch` all
// roll-outs but the last two calibrate, one an iteration; the last two judge. Writes a table.
//
//   plumb-step-vs-trajectory robots/pendulum runs/a runs/b ... --csv table.csv

#include <fmt/format.h>

#include <fstream>
#include <iostream>

#include "calibrator/checkpoint.h"
#include "calibrator/simopt.h"
#include "common/process.h"

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

// Root mean square prediction errors on the held-out roll-outs, one per horizon.
Eigen::VectorXd Judge(const RobotDescription& robot, const std::vector<Rollout>& rollouts, const Method& method,
                      uint64_t seed) {
  SimOpt simopt(robot, seed, 2, method.objective);
  const size_t training = rollouts.size() - kHeldOut;
  for (size_t i = 0; i < training && !method.prior; ++i) {
    simopt.Begin({rollouts[i]});
    while (!simopt.Update()) {
    }
  }
  Eigen::VectorXd physical(simopt.state().distribution.mean.size());
  for (Eigen::Index i = 0; i < physical.size(); ++i) {
    physical(i) = robot.parameters[static_cast<size_t>(i)].ToPhysical(simopt.state().distribution.mean(i));
  }
  Discrepancy discrepancy(robot);
  const auto held_out = std::span(rollouts).last(kHeldOut);
  Eigen::VectorXd errors(static_cast<Eigen::Index>(robot.calibration.horizons.size()));
  for (Eigen::Index h = 0; h < errors.size(); ++h) {
    errors(h) = discrepancy.PredictionError(physical, held_out, robot.calibration.horizons[static_cast<size_t>(h)]);
  }
  return errors;
}

int Compare(const std::string& robot_path, const std::vector<std::string>& folders, int seeds, const std::string& csv) {
  const RobotDescription robot = LoadRobot(robot_path);
  std::ofstream table;
  if (!csv.empty()) table.open(csv);
  table << "method,run,seed";
  std::cout << fmt::format("{:<34}", "root mean square error, held out");
  for (const int n : robot.calibration.horizons) {
    table << ",error_" << n;
    std::cout << fmt::format("{:>12}", fmt::format("{}-step", n));
  }
  table << "\n";
  std::cout << std::endl;
  for (const Method& method : kMethods) {
    Eigen::VectorXd squared = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(robot.calibration.horizons.size()));
    int count = 0;
    for (const std::string& folder : folders) {
      const std::vector<Rollout> rollouts = LoadRollouts(std::filesystem::path(folder) / "calibration");
      if (rollouts.size() <= kHeldOut) throw std::runtime_error(folder + ": holds too few roll-outs");
      for (int seed = 1; seed <= (method.prior ? 1 : seeds); ++seed) {
        const Eigen::VectorXd errors = Judge(robot, rollouts, method, static_cast<uint64_t>(seed));
        squared += errors.cwiseAbs2();
        ++count;
        table << method.name << "," << folder << "," << seed;
        for (const double error : errors) table << "," << error;
        table << "\n";
      }
    }
    std::cout << fmt::format("{:<34}", method.name);
    for (const double x : squared) std::cout << fmt::format("{:12.5f}", std::sqrt(x / count));
    std::cout << std::endl;
  }
  return 0;
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  std::string robot, csv;
  std::vector<std::string> folders;
  int seeds = 3;
  return plumb::Run(
      "plumb-step-vs-trajectory", "Compares step-based with trajectory-based SimOpt on recorded roll-outs.", argc, argv,
      [&](CLI::App& app) {
        app.add_option("robot", robot, "robot folder or TOML file")->required();
        app.add_option("runs", folders, "output folders of plumb launch")->required();
        app.add_option("--seeds", seeds, "of the calibration, per run")->capture_default_str();
        app.add_option("--csv", csv, "write every single result here");
      },
      [&](plumb::Process&) { return plumb::Compare(robot, folders, seeds, csv); });
}
