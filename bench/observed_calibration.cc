// How much accuracy the observer costs calibration: parameters from estimated states beside those
// from true states of the same motions. A table for docs/measurements/estimator.md.
// build/bench/observed_calibration [motions [robot]]

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <functional>
#include <string>

#include "calibrator/results/calibration.h"
#include "sim/parameters.h"
#include "tests/calibrator/hop_on_bus.h"
#include "tests/estimator/observer_errors.h"

namespace plumb {
namespace {

struct StateSource {
  const char* name;
  States states;
};
constexpr StateSource kSources[] = {{"true", States::kTrue},
                                    {"smoothed", States::kSmoothed},
                                    {"smoothed, taken for exact", States::kCertain},
                                    {"causal", States::kCausal}};

using Motion = std::function<std::vector<Samples>(uint32_t seed)>;  // episodes

void Print(const std::string& name, const RobotDescription& robot, const Motion& motion_of,
           uint32_t motions) {
  const std::vector<Knowable> knowable = KnowableOf(robot);
  for (const StateSource& source : kSources) {
    std::vector<double> square(knowable.size(), 0), sum(knowable.size(), 0),
        claimed(knowable.size(), 0);
    std::vector<int> covered(knowable.size(), 0);
    int alarms = 0;
    double discrepancy = 0;
    for (uint32_t seed = 1; seed <= motions; ++seed) {
      const Eigen::VectorXd truth = HiddenParameters(robot, seed);
      const std::vector<Log> logs{ObservedLog(robot, motion_of(seed), source.states)};
      const Findings found = Calibrate(robot, logs, {});
      alarms += found.misspecification.alarm;
      discrepancy += found.stages.front().discrepancy / motions;
      if (found.misspecification.alarm)
        fmt::print(stderr, "\n{} {} {}: {}\n", name, source.name, seed,
                   found.misspecification.summary);
      const Gaussian posterior = Moments(found.posterior);
      const Eigen::VectorXd hidden =
          truth.array().log();  // both robots' parameters have logarithms for coordinates
      for (size_t i = 0; i < knowable.size(); ++i) {
        const double error = knowable[i].power.dot(posterior.mean - hidden);
        const double sd =
            std::sqrt(knowable[i].power.dot(posterior.covariance * knowable[i].power));
        square[i] += error * error, sum[i] += error, claimed[i] += sd * sd;
        covered[i] += std::abs(error) < 1.96 * sd;
      }
      fmt::print(stderr, "\r{} {}: {} of {} ", name, source.name, seed, motions);
    }
    for (size_t i = 0; i < knowable.size(); ++i) {
      fmt::print("| {} | {} | {} | {:.3f} | {:+.3f} | {:.3f} | {:.0f} % | {:.2f} | {} |\n", name,
                 source.name, knowable[i].name, 100 * std::sqrt(square[i] / motions),
                 100 * sum[i] / motions, 100 * std::sqrt(claimed[i] / motions),
                 100. * covered[i] / motions, discrepancy, alarms);
      std::fflush(stdout);
    }
  }
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  using namespace plumb;
  const auto motions = static_cast<uint32_t>(argc > 1 ? std::atoi(argv[1]) : 20);
  fmt::print(
      "| robot | states | of | rms error % | mean error % | claimed sd % | within 95 % | "
      "discrepancy | "
      "alarms |\n"
      "|---|---|---|---|---|---|---|---|---|\n");
  const std::string only = argc > 2 ? argv[2] : "";
  for (const std::string name : {"pendulum", "hopper"}) {
    if (!only.empty() && only != name) continue;
    RobotDescription robot =
        WithSimulatedNoise(LoadRobot(std::string(PLUMBLINE_SOURCE) + "/robots/" + name));
    const Recordings training = Record(robot, 1000, 3);
    const TunedNoise noise =
        TuneNoise(robot, [&](StateObserver& observer) { Play(training, observer); });
    for (size_t i = 0; i < noise.joints.size(); ++i) robot.joints[i].noise = noise.joints[i];
    const auto simulated = [&](uint32_t seed) {
      const Eigen::VectorXd truth = HiddenParameters(robot, seed);
      return std::vector<Samples>{name == "hopper" ? Hop(robot, seed, 2, truth)
                                                   : Swing(robot, seed, 10, truth)};
    };
    Print(name, robot, simulated, motions);
  }
  RobotDescription hopper = LoadRobot(std::string(PLUMBLINE_SOURCE) + "/robots/hopper");
  hopper.estimator.delay = 0;  // in virtual time frames arrive at once
  if (only.empty() || only == "bus") {
    Print(
        "hopper on its bus", hopper,
        [&](uint32_t seed) { return std::vector<Samples>{HopOnBus(hopper, seed)}; }, motions);
  }
  if (only.empty() || only == "bang-bang") {
    Print(
        "hopper, bang-bang", hopper, [&](uint32_t seed) { return BangBangOnBus(hopper, seed); },
        motions);
  }
}
