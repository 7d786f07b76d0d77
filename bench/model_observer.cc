// How well the filter on the simulator's dynamics knows the state of simulated robots, beside the kinematic
// one, and what a step of it costs: a table for docs/measurements.md. build/bench/model_observer [runs]

#include <fmt/format.h>

#include <chrono>
#include <cstdlib>
#include <string>

#include "tests/estimator/model/model_errors.h"

namespace plumb {
namespace {

double MicrosecondsPerStep(const RobotDescription& robot, const Recordings& recordings) {
  using Clock = std::chrono::steady_clock;
  StateObserver kinematic(robot);
  UnscentedObserver model(Assumed(robot));
  Clock::duration spent{};
  int64_t steps = 0;
  for (const SimulatedReadings::Sample& sample : recordings.front()) {
    kinematic.OnJointState(sample.joints);
    const auto start = Clock::now();
    model.OnJointState(sample.joints, kinematic.state());
    spent += Clock::now() - start;
    ++steps;
  }
  return std::chrono::duration<double, std::micro>(spent).count() / static_cast<double>(steps);
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  using namespace plumb;
  const int runs = argc > 1 ? std::atoi(argv[1]) : 6;
  fmt::print(
      "| joint | q causal | q model | v causal | v smoothed | v model | masses + 3 % | + 10 % | + 30 % | "
      "NEES v | + 30 % |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|\n");
  std::string costs;
  for (const char* name : {"pendulum", "hopper"}) {
    const RobotDescription robot =
        WithSimulatedNoise(LoadRobot(std::string(PLUMBLINE_SOURCE) + "/robots/" + name));
    const Recordings recordings = Record(robot, 1, runs);
    const ObserverErrors observed = Observe(robot, recordings);
    std::vector<ModelErrors> errors;
    for (const double mass : {1.0, 1.03, 1.1, 1.3})
      errors.push_back(Compare(robot, Assumed(robot, mass), recordings));
    for (size_t i = 0; i < observed.joints.size(); ++i) {
      const StateErrors &kinematic = errors[0].kinematic[i], &right = errors[0].model[i],
                        &wrong = errors[3].model[i];
      fmt::print(
          "| {} {} | {:.2g} | {:.2g} | {:.2g} | {:.2g} | {:.2g} | {:.2g} | {:.2g} | {:.2g} | {:.2f} | {:.2f} "
          "|\n",
          name, robot.joints[i].name, kinematic.q(), right.q(), kinematic.v(),
          observed.joints[i].smoothed.v(), right.v(), errors[1].model[i].v(), errors[2].model[i].v(),
          wrong.v(), right.nees_v(), wrong.nees_v());
    }
    costs += fmt::format("{}: {:.1f} us a step, {} restarts\n", name, MicrosecondsPerStep(robot, recordings),
                         errors[0].restarts);
  }
  fmt::print("\n{}", costs);
}
