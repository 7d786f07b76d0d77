// Floods of well-formed messages to processes that do not get round to them, and to the calibrator,
// which remembers what it hears: nobody's memory grows beyond what docs/security.md says. The
// trainer's, while it trains, is in flood_test.cc.

#include <sys/ptrace.h>
#include <sys/wait.h>

#include <cmath>

#include "plumb/calibration_status_t.hpp"
#include "plumb/training_status_t.hpp"
#include "tests/process/flood.h"
#include "tests/process/launch.h"

namespace plumb {
namespace {

constexpr int64_t kQueue = 32'768;  // [kB] of messages that wait on a channel

/// For as long as it lives, the thread that main() runs in stands still, as if it computed, and all
/// others go on, the one that receives among them. Meanwhile nobody may ask whether a child runs.
class Computing {
 public:
  explicit Computing(const Child& child) : process_(child.pid()) {
    INFO("PTRACE_SEIZE: are processes allowed to trace their children here?");
    REQUIRE(ptrace(PTRACE_SEIZE, process_, nullptr, nullptr) == 0);
    REQUIRE(ptrace(PTRACE_INTERRUPT, process_, nullptr, nullptr) == 0);
    REQUIRE(waitpid(process_, nullptr, __WALL) == process_);
  }
  ~Computing() { ptrace(PTRACE_DETACH, process_, nullptr, nullptr); }
  Computing(const Computing&) = delete;
  Computing& operator=(const Computing&) = delete;

 private:
  const pid_t process_;
};

/// Each of a channel that calibrator, launch or recorder listens to; 40 kB, so that what a message
/// costs beside its bytes does not count.
std::vector<uint8_t> Large(const std::string& channel) {
  constexpr int kJoints = 1000;
  const std::vector<double> numbers(kJoints, 1);
  const std::string words(40'000, 'x');
  if (channel == "ROBOT_STATE_SMOOTHED") {
    robot_state_t state{};
    state.num_positions = state.num_velocities = kJoints;
    state.q = state.v = state.effort = state.q_sd = state.v_sd = numbers;
    return Said(channel, state);
  }
  if (channel == "JOINT_COMMAND") {
    joint_command_t command{};
    command.num_joints = kJoints;
    command.effort = command.position = command.velocity = command.kp = command.kd = numbers;
    return Said(channel, command);
  }
  if (channel == "CONTROLLER_STATUS") {
    controller_status_t status{};
    status.reason = words;
    return Said(channel, status);
  }
  if (channel == "CALIBRATION_STATUS") {
    calibration_status_t status{};
    status.gap = words;
    return Said(channel, status);
  }
  if (channel == "TRAINING_STATUS") {
    training_status_t status{};
    status.decision = words;
    return Said(channel, status);
  }
  REQUIRE(channel == "DRIVER_STATUS");
  driver_status_t status{};
  status.reason = words;
  return Said(channel, status);
}

/// Floods a process that computes, until its memory has nearly grown by what its queues may have,
/// and as much again. @return [kB] by which it has grown.
int64_t Grown(Stage& stage, Child& child, const std::vector<std::string>& channels, int64_t bound) {
  REQUIRE(child.running());
  const MulticastAddress group = ParseUdpm(stage.lcm_url);
  const RawSender sender(group.group, group.port);
  std::vector<std::vector<uint8_t>> messages;
  for (const std::string& channel : channels) messages.push_back(Large(channel));
  const int64_t before = MostMemory(child);
  REQUIRE(before > 0);
  const auto grown = [&] { return MostMemory(child) - before; };
  const Computing computing(child);
  int64_t sent = 0;
  const auto send = [&] {
    for (int i = 0; i < 10; ++i) {
      for (const std::vector<uint8_t>& message : messages) sender.Send(message);
      ++sent;
    }
  };
  REQUIRE(stage.WaitUntil([&] { return send(), 10 * grown() > 9 * bound; }, kLong));
  for (const int64_t enough = 2 * sent; sent < enough; stage.Listen(0.001)) send();
  INFO(sent << " messages on each channel");
  CHECK(sent * 40'000 > 1500 * bound / static_cast<int64_t>(channels.size()));
  return grown();
}

/// It goes on, and says of each channel that it has lost some.
void CheckGoesOn(Stage& stage, Child& child, const std::vector<std::string>& channels) {
  const auto told = [&](const std::string& channel) {
    const std::string log = Read(child.log());
    const size_t at = log.find(channel + ": ");
    return at != std::string::npos && log.find("messages lost", at) != std::string::npos;
  };
  for (const std::string& channel : channels) {
    INFO(channel);
    CHECK(stage.WaitUntil([&] { return told(channel); }, kLong));
  }
  CHECK(child.running());
}

TEST_CASE("the calibrator's memory has a bound while it computes") {
  Stage stage(116, "pendulum", Stage::Time::kReal);
  Child& calibrator =
      stage.Start("plumb-calibrator", {"--checkpoint", stage.folder / "calibration"});
  Subscriber<calibration_status_t> calibrations(stage.messenger, "CALIBRATION_STATUS");
  REQUIRE(stage.WaitUntil([&] { return calibrations.received() > 0; }, kLong));
  const std::vector<std::string> channels{"ROBOT_STATE_SMOOTHED", "JOINT_COMMAND",
                                          "CONTROLLER_STATUS"};
  const int64_t bound = 3 * kQueue, grown = Grown(stage, calibrator, channels, bound);
  INFO("grown by " << grown << " kB");
  CHECK(4 * grown < 5 * bound);
  CheckGoesOn(stage, calibrator, channels);
}

TEST_CASE("launch's memory has a bound while it is busy") {
  Stage stage(117, "pendulum", Stage::Time::kReal);
  const std::string key = stage.UseKey();  // without one the second speaker would end the run
  Child launch = Launch(stage, {"--real-time", "--key", key});
  REQUIRE(stage.WaitForDriver(driver_status_t::ARMED, kLong));
  const std::vector<std::string> channels{"DRIVER_STATUS", "CONTROLLER_STATUS",
                                          "CALIBRATION_STATUS", "TRAINING_STATUS"};
  // Whoever has a key hears the driver twice: for the run's number, too.
  const int64_t bound = 5 * kQueue, grown = Grown(stage, launch, channels, bound);
  INFO("grown by " << grown << " kB; " << launch.Tail(20));
  CHECK(4 * grown < 5 * bound);
  CheckGoesOn(stage, launch, channels);
  launch.Signal(SIGINT);
  CHECK(stage.WaitUntil([&] { return !launch.running(); }, kLong));
  CHECK(launch.ending() == "exit status 130");
}

TEST_CASE("the recorder's memory has a bound while it waits for the disk") {
  Stage stage(118, "pendulum", Stage::Time::kReal);
  Child record(
      "plumb",
      {Stage::Binary("plumb"), "record", stage.folder / "all.lcmlog", "--lcm-url", stage.lcm_url},
      stage.folder / "record.log");
  REQUIRE(stage.WaitUntil([&] { return record.Tail(5).find("recording to") != std::string::npos; },
                          kLong));
  const int64_t grown = Grown(stage, record, {"JOINT_COMMAND"}, kQueue);
  INFO("grown by " << grown << " kB");
  CHECK(4 * grown < 5 * kQueue);
  CheckGoesOn(stage, record, {".*"});
}

// In virtual time, in which no message is lost, however many there are.
TEST_CASE("what the calibrator remembers of messages has a bound") {
  Stage stage(119);
  Subscriber<calibration_status_t> calibrations(stage.messenger, "CALIBRATION_STATUS");
  Child& calibrator =
      stage.Start("plumb-calibrator", {"--checkpoint", stage.folder / "calibration"});
  REQUIRE(stage.WaitUntil([&] { return calibrations.received() > 0; }, kLong));
  const int64_t before = MostMemory(calibrator);
  REQUIRE(before > 0);
  Publisher<robot_state_t> states(stage.messenger, "ROBOT_STATE_SMOOTHED");
  Publisher<joint_command_t> commands(stage.messenger, "JOINT_COMMAND");
  robot_state_t state{};
  state.num_positions = state.num_velocities = 1, state.valid = 1;
  state.q = state.v = state.effort = {0};
  state.q_sd = state.v_sd = {1e-3};
  joint_command_t command{};
  command.num_joints = 1, command.state_sequence = -1;  // nothing is to be joined
  command.effort = {1};
  command.position = command.velocity = command.kp = command.kd = {NAN};
  constexpr int kSent = 400'000, kAtOnce = 500, kSteps = 20'000;
  for (int i = 0; i < kSent; ++i) {
    state.sequence = command.sequence = i;
    state.utime = command.utime = stage.Now() + i;
    command.episode = i / kSteps, command.step = i % kSteps;
    states.Publish(state), commands.Publish(command);
    if (i % kAtOnce == 0) stage.Listen(0.05);  // the calibrator takes 1000 at a time
  }
  stage.Listen(2);
  REQUIRE(calibrator.running());
  const int64_t grown = MostMemory(calibrator) - before;
  INFO("grown by " << grown << " kB");
  CHECK(grown > 60'000);   // it has heard them
  CHECK(grown < 110'000);  // states 80 MB, commands 13 MB, and what is on its way
}

}  // namespace
}  // namespace plumb
