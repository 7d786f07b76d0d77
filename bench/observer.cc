// How well the observer knows the state of simulated robots, beside what is usually done: a table
// for docs/measurements/estimator.md. build/bench/observer [runs]

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <string>

#include "tests/estimator/observer_errors.h"

namespace plumb {
namespace {

void Print(const std::string& name, const RobotDescription& robot, const Recordings& recordings) {
  const ObserverErrors errors = Observe(robot, recordings);
  for (size_t i = 0; i < errors.joints.size(); ++i) {
    const JointErrors& e = errors.joints[i];
    fmt::print(
        "| {} {} | {:.2g} | {:.2g} | {:.2g} | {:.2g} | {:.2g} | {:.2g} | {:.2g} | {:.0f} | {:.2f} "
        "| {:.2f} | {:.0f} % | {:.0f} % |\n",
        name, robot.joints[i].name, e.differencing.q(), e.causal.q(), e.smoothed.q(),
        e.differencing.v(), e.filtered.v(), e.causal.v(), e.smoothed.v(),
        e.differencing.v() / e.smoothed.v(), e.smoothed.nees_q(), e.smoothed.nees_v(),
        100 * e.smoothed.covered_v(), 100 * e.causal.covered_v());
  }
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  using namespace plumb;
  const int runs = argc > 1 ? std::atoi(argv[1]) : 20;
  fmt::print(
      "| joint | q diff | q causal | q smoothed | v diff | v first order | v causal | v smoothed | "
      "diff / smoothed | "
      "NEES q | NEES v | within 95 % | causal "
      "|\n|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const bool hopper : {false, true}) {
    RobotDescription robot = WithSimulatedNoise(LoadRobot(
        std::string(PLUMBLINE_SOURCE) + (hopper ? "/robots/hopper" : "/robots/pendulum")));
    const Recordings training = Record(robot, 1000, 5);
    const TunedNoise noise =
        TuneNoise(robot, [&](StateObserver& observer) { Play(training, observer); });
    for (size_t i = 0; i < noise.joints.size(); ++i) {
      const NoiseDescription& found = noise.joints[i];
      fmt::print(stderr,
                 "{}: position_sd {:.3g} velocity_sd {:.3g} jerk {:.4g} effort_step {:.3g}, "
                 "deviance {:.3f} -> {:.3f}\n",
                 robot.joints[i].name, found.position_sd, found.velocity_sd, found.jerk,
                 found.effort_step, noise.before[i], noise.after[i]);
    }
    const Recordings fresh = Record(robot, 1, runs);
    Print(robot.name + " as shipped:", robot, fresh);
    for (size_t i = 0; i < noise.joints.size(); ++i) robot.joints[i].noise = noise.joints[i];
    Print(robot.name + " tuned:", robot, fresh);
  }
}
