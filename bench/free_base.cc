// How often a robot whose base nothing holds is stopped because it does not know where it is: whole
// episodes of a policy behind the bus, through driver and observer, in virtual time. For
// docs/measurements/estimator.md.
// build/bench/free_base ROBOT POLICY [first seed of the hidden robots [robots [episodes of each]]]

#include <fmt/format.h>

#include <cstdint>
#include <cstdlib>
#include <exception>
#include <string>

#include "experiments/bus_robot.h"
#include "sim/parameters.h"
#include "sim/tasks/task.h"
#include "trainer/policy_file.h"

namespace plumb {
namespace {

void Play(const RobotDescription& robot, const GaussianPolicy& policy, uint64_t seed,
          uint32_t episodes) {
  BusRobot real(robot, robot, HiddenParameters(robot, seed), seed);
  uint32_t stopped = 0, fallen = 0;
  double sum = 0;
  std::string why;
  for (uint32_t k = 0; k < episodes; ++k) {
    const RobotEpisode episode = real.Run(policy, false, robot.task.steps, k);
    sum += episode.sum_of_rewards;
    if (real.stopped().empty()) {
      fallen += episode.trial.fell;
      continue;
    }
    ++stopped;
    why = ", " + real.stopped();
  }
  fmt::print("| {} | {} | {}{} | {} | {:.0f} |\n", seed, episodes, stopped, why, fallen,
             sum / episodes);
  std::fflush(stdout);
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  using namespace plumb;
  if (argc < 3) {
    fmt::print(stderr, "{} ROBOT POLICY [first seed [robots [episodes]]]\n", argv[0]);
    return 2;
  }
  const auto number = [&](int i, uint32_t otherwise) {
    return argc > i ? static_cast<uint32_t>(std::atoi(argv[i])) : otherwise;
  };
  try {
    const RobotDescription robot = LoadRobot(argv[1]);
    const GaussianPolicy policy = LoadPolicy(argv[2], robot, *MakeTask(robot));
    fmt::print(
        "| hidden robot | episodes | stopped | fallen | mean return |\n|---|---|---|---|---|\n");
    for (uint32_t i = 0; i < number(4, 3); ++i)
      Play(robot, policy, number(3, 11) + i, number(5, 15));
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 1;
  }
  return 0;
}
