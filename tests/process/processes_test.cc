// Whichever other process is stopped or killed: no torque is on the bus for longer than expiry and one cycle
// after the last command was made, whoever lives on.

#include <algorithm>

#include "tests/process/stage.h"

namespace plumb {
namespace {

constexpr int kIdle = 1;  // CANSimple axis state
// The kernel stamps the frames: only the driver may be late, and a command on its way to it. That is a busy
// machine's.
constexpr int64_t kSlack = 60'000;  // [us]

int64_t Longest(const Stage& stage) {
  return static_cast<int64_t>((stage.robot.driver.expiry + stage.robot.driver.cycle) * 1e6) + kSlack;
}

/// Listens until there have been torques for a while, armed by a person where a busy machine has stopped the
/// robot.
void ListenToTorques(Stage& stage) {
  REQUIRE(stage.BeginEpisode());
  stage.longest_alone = 0;
  const int64_t begin = Stage::RealUtime();
  REQUIRE(stage.WaitUntil([&] { return stage.last_torque_time > begin; }, 2));
  stage.Listen(0.5);
}

TEST_CASE("a calibrator and a trainer that are stopped or killed are missed by nobody") {
  Stage stage(60);
  stage.Start("plumb-calibrator", {"--checkpoint", stage.folder / "calibrator"});
  stage.Start("plumb-trainer", {"--checkpoint", stage.folder / "trainer"});
  stage.RunWithTorque();
  for (const int signal : {SIGSTOP, SIGKILL}) {
    for (const char* name : {"plumb-calibrator", "plumb-trainer"}) {
      INFO(name << " got signal " << signal);
      stage.children.at(name)->Signal(signal);
      ListenToTorques(stage);
      CHECK(stage.longest_alone > 0);
      CHECK(stage.longest_alone <= Longest(stage));
    }
  }
}

TEST_CASE("a controller or an estimator that is stopped or killed") {
  const char* name = GENERATE("plumb-controller", "plumb-estimator");
  const int signal = GENERATE(SIGSTOP, SIGKILL);
  INFO(name << " gets signal " << signal);
  Stage stage(61);
  stage.RunWithTorque();
  stage.longest_alone = 0;
  stage.children.at(name)->Signal(signal);
  REQUIRE(stage.WaitForDriver(driver_status_t::FAULT, 5));
  REQUIRE(stage.WaitUntil([&] { return stage.axis_state == kIdle; }, 2));
  CHECK(stage.longest_alone <= Longest(stage));
  const int64_t last_torque = stage.last_torque_time;
  stage.children.at(name)->Signal(SIGCONT);
  stage.Listen(0.5);
  CHECK(stage.last_torque_time == last_torque);
}

/// The processes that a process has started, by name.
std::map<std::string, pid_t> ChildrenOf(pid_t parent) {
  std::map<std::string, pid_t> children;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    const pid_t pid = std::atoi(entry.path().filename().c_str());
    if (pid == 0) continue;
    const std::string status = Read(entry.path() / "status");
    if (status.find("\nPPid:\t" + std::to_string(parent) + "\n") == std::string::npos) continue;
    std::string program = Read(entry.path() / "cmdline");
    program = std::filesystem::path(program.c_str()).filename();
    children[program] = pid;
  }
  return children;
}

TEST_CASE(
    "a launch that is stopped changes nothing; one that is killed takes all with it, and the drive ends up "
    "idle") {
  Stage stage(62);
  Child launch("plumb",
               {Stage::Binary("plumb"), "launch", stage.robot_folder, "--lcm-url", stage.lcm_url, "--bus",
                stage.bus_url, "--output", stage.folder / "run"},
               stage.folder / "launch.log");
  // It has the robot move as soon as the first policy is trained; a policy of ours need not be.
  REQUIRE(stage.WaitUntil([&] { return stage.controllers.received() > 0; }, 30));
  const bool moves = stage.BeginEpisode();
  INFO(launch.Tail(20));
  REQUIRE(moves);
  launch.Signal(SIGSTOP);
  ListenToTorques(stage);
  CHECK(stage.longest_alone <= Longest(stage));
  CHECK(ChildrenOf(launch.pid()).contains("plumb-driver"));

  stage.BeginEpisode();
  const std::map<std::string, pid_t> processes = ChildrenOf(launch.pid());
  REQUIRE(processes.size() == 6);
  stage.longest_alone = 0;
  launch.Signal(SIGKILL);
  CHECK(stage.WaitUntil(
      [&] {
        return std::ranges::none_of(processes, [](const auto& process) {
          const std::string status = Read("/proc/" + std::to_string(process.second) + "/status");
          return !status.empty() && status.find("State:\tZ") == std::string::npos;
        });
      },
      5));
  CHECK(stage.torque == 0);
  CHECK(stage.longest_alone <= Longest(stage));
}

}  // namespace
}  // namespace plumb
