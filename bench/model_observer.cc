// How well the filter on the simulator's dynamics knows the state of simulated robots, beside the
// kinematic one, and what a step of it costs: a table for docs/measurements/estimator.md.
// build/bench/model_observer [runs]

#include <fmt/format.h>

#include <cstdlib>
#include <ctime>
#include <string>

#include "tests/estimator/model/model_errors.h"

namespace plumb {
namespace {

// Of processor time.
double MicrosecondsPerStep(const RobotDescription& robot, const Recordings& recordings) {
  StateObserver observer(robot);
  std::vector<robot_state_t> kinematic;
  for (const SimulatedReadings::Sample& sample : recordings.front()) {
    observer.OnJointState(sample.joints);
    kinematic.push_back(observer.state());
  }
  UnscentedObserver model(Assumed(robot));
  const std::clock_t start = std::clock();
  for (size_t k = 0; k < kinematic.size(); ++k)
    model.OnJointState(recordings.front()[k].joints, kinematic[k]);
  return 1e6 * static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC /
         static_cast<double>(kinematic.size());
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  using namespace plumb;
  const int runs = argc > 1 ? std::atoi(argv[1]) : 6;
  fmt::print(
      "| joint | q causal | q model | v causal | v smoothed | v model | masses + 3 % | + 10 % | + "
      "30 % | "
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
          "| {} {} | {:.2g} | {:.2g} | {:.2g} | {:.2g} | {:.2g} | {:.2g} | {:.2g} | {:.2g} | "
          "{:.2f} | {:.2f} "
          "|\n",
          name, robot.joints[i].name, kinematic.q(), right.q(), kinematic.v(),
          observed.joints[i].smoothed.v(), right.v(), errors[1].model[i].v(),
          errors[2].model[i].v(), wrong.v(), right.nees_v(), wrong.nees_v());
    }
    costs += fmt::format("{}: {:.1f} us a step, {} restarts\n", name,
                         MicrosecondsPerStep(robot, recordings), errors[0].restarts);
  }
  fmt::print("\n{}", costs);
}
