#include "bench/realtime/chain_robot.h"

#include <fmt/format.h>

#include <fstream>
#include <regex>
#include <sstream>
#include <utility>

#include "controller/policy.h"
#include "sim/tasks/task.h"
#include "tests/legs_on_stand.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr int kObservedPort = 23190;

std::string BusUrl(int port) { return fmt::format("udp:239.74.163.2:{}", port); }

/// robots/pendulum with a millisecond for everything but control, and positions that do not repeat.
fs::path QuickPendulum(const fs::path& source, const fs::path& folder) {
  fs::create_directories(folder);
  fs::copy_file(source / "robots/pendulum/robot.urdf", folder / "robot.urdf",
                fs::copy_options::overwrite_existing);
  std::stringstream text;
  text << std::ifstream(source / "robots/pendulum/robot.toml").rdbuf();
  std::string toml = text.str();
  for (const auto& [key, value] : {std::pair{"cycle", "0.001"},
                                   {"measurement", "0.001"},
                                   {"substep", "0.001"},
                                   {"period", "0.01"},
                                   {"steps", "1000000"},
                                   {"encoder_bits", "24"}}) {
    toml = std::regex_replace(toml, std::regex("(^|\n)" + std::string(key) + " = [0-9.]+"),
                              "$1" + std::string(key) + " = " + value);
  }
  toml = std::regex_replace(toml, std::regex("udp:[0-9.:]+"), ObservedBus());
  std::ofstream(folder / "robot.toml") << toml;
  return folder;
}

}  // namespace

std::string ObservedBus() { return BusUrl(kObservedPort); }

fs::path PrepareRobot(ChainRobot robot, const fs::path& source, const fs::path& folder) {
  if (robot == ChainRobot::kPendulum) return QuickPendulum(source, folder);
  LegsOnStand::Write(source / "robots", folder,
                     {ObservedBus(), BusUrl(kObservedPort + 1), BusUrl(kObservedPort + 2),
                      BusUrl(kObservedPort + 3)});
  return folder;
}

policy_t SwingingPolicy(const RobotDescription& robot) {
  constexpr int kNeurons = 4;
  const int observations = MakeTask(robot)->observation_size(),
            actions = static_cast<int>(robot.driven().size());
  GaussianPolicy policy(PolicyShape{observations, {kNeurons}, actions});
  const Eigen::Index effort = (observations + 1) * kNeurons;  // first neuron -> first joint's
  if (actions == 1) {
    policy.parameters(0) = 0.5f;        // cos q -> first neuron
    policy.parameters(kNeurons) = 1.f;  // sin q -> first neuron
    policy.parameters(effort) = 0.5f;
  } else {
    // Pushed the way that it goes, it never comes to rest.
    policy.parameters(actions * kNeurons) = 0.3f;  // first v -> first neuron
    policy.parameters(effort) = 0.05f;
  }
  policy.action_scale = robot.effort_limits().cast<float>();
  policy_t message = policy.ToMessage();
  message.purpose = policy_t::EVALUATE;
  message.episodes = 1000;
  return message;
}

}  // namespace plumb
