// Who says what: forgeries beside the real processes, with a key and without, and requests that
// nobody answers.

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "common/message_bytes.h"
#include "controller/policy.h"
#include "plumb/calibration_status_t.hpp"
#include "plumb/joint_state_t.hpp"
#include "tests/process/launch.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Catch::Contains;

constexpr int kIdle = 1, kRunning = 8;  // CANSimple axis states

/// Says messages without a seal, as anybody can.
struct Forger {
  explicit Forger(Messenger& m) : messenger(m) {}
  template <class Message>
  void Say(const std::string& channel, const Message& message) {
    messenger.Publish(channel, Encode(message));
  }
  void JointState(double effort) {
    joint_state_t m{};
    m.utime = utime;
    m.sequence = 1'000'000'000;
    m.num_joints = 1;
    m.measured = {utime};
    m.position = m.velocity = {0};
    m.effort_measured = m.effort_sent = m.effort_applied = {effort};
    m.valid = {1};
    Say("JOINT_STATE", m);
  }
  /// 70 episodes that never were, later than all that are, so that nothing else is remembered.
  void Commands() {
    joint_command_t m{};
    m.utime = utime;
    m.num_joints = 1;
    m.effort = {0};
    m.position = m.velocity = m.kp = m.kd = {NAN};
    for (int i = 0; i < 70; ++i) {
      m.episode = utime + 1'000'000'000 + i;
      m.sequence = 1'000'000 + i;
      Say("JOINT_COMMAND", m);
    }
  }
  /// All is done, with a return of 4711.
  void Finished(int iteration) {
    controller_status_t m{};
    m.utime = utime;
    m.policy_iteration = iteration;
    m.phase = controller_status_t::COMPLETE;
    m.purpose = policy_t::EVALUATE;
    m.num_episodes = 1;
    m.episode = m.first_state_sequence = m.last_state_sequence = {1};
    m.returns = m.late_rate = {4711};
    m.steps = {200};
    m.fell = {0};
    Say("CONTROLLER_STATUS", m);
    calibration_status_t c{};
    c.iteration = iteration;
    c.num_parameters = 3;
    c.mean = c.sd = {47, 47, 47};
    Say("CALIBRATION_STATUS", c);
  }
  Messenger& messenger;
  int64_t utime = 0;
};

std::vector<std::string> Short(const fs::path& summary) {
  return {"--real-time",           "--speed", "2",         "--iterations", "1",
          "--evaluation-episodes", "1",       "--summary", summary};
}

TEST_CASE("with a key, what is not signed changes nothing on any channel") {
  Stage stage(12);
  stage.UseKey();
  stage.RunWithTorque();
  Forger forger(stage.messenger);
  const int64_t forged = stage.drivers.newest().commands_forged;
  robot_state_t state = stage.states.newest();
  driver_status_t driver = stage.drivers.newest();
  policy_t policy{};
  for (int i = 0; i < 20; ++i) {
    forger.utime = state.utime = driver.utime = policy.utime = stage.Now();
    forger.JointState(1e308);
    state.sequence = 1'000'000'000 + i;
    state.q = {NAN};
    forger.Say("ROBOT_STATE", state);
    driver.state = driver_status_t::IDLE;
    forger.Say("DRIVER_STATUS", driver);
    policy = GaussianPolicy(PolicyShape{3, {4}, 1}).ToMessage();
    policy.iteration = 5;
    forger.Say("POLICY", policy);
    forger.Commands();
    stage.Listen(0.05);
  }
  CHECK(stage.WaitUntil([&] { return stage.drivers.newest().commands_forged == forged + 20 * 70; },
                        1));
  CHECK(stage.drivers.newest().state == driver_status_t::ARMED);
  CHECK(stage.controllers.newest().phase == controller_status_t::RUNNING);
  CHECK(stage.controllers.newest().policy_iteration == 0);
  CHECK(stage.states.newest().valid);
  CHECK(std::isfinite(stage.states.newest().q[0]));
  CHECK(stage.torque != 0);
  for (auto& [name, child] : stage.children) {
    INFO(name);
    CHECK(child->running());
  }
  const std::string log = stage.Log("plumb-estimator");
  CHECK_THAT(log, Contains("JOINT_STATE refused: not signed with the driver\'s key"));
  CHECK(std::count(log.begin(), log.end(), '\n') < 5);  // of 20: whoever floods it fills no disk
}

TEST_CASE("in real time a second speaker ends a run without a key, and is named") {
  Stage stage(13, "pendulum", Stage::Time::kReal);
  LearnLittle(stage);
  Child launch = Launch(stage, Short(stage.folder / "summary.json"));
  Forger forger(stage.messenger);
  SECTION("one who says that all is done, from the beginning on") {
    REQUIRE(stage.WaitUntil(
        [&] {
          forger.utime = stage.Now();
          if (stage.drivers.received() > 0) forger.Finished(1);
          return !launch.running();
        },
        kLong));
    CHECK_THAT(launch.Tail(20), Contains("two speak on C"));
  }
  SECTION("one who commands") {
    REQUIRE(stage.WaitForDriver(driver_status_t::ARMED, kLong));
    REQUIRE(stage.WaitUntil([&] { return stage.commands.received() > 0; }, kLong));
    forger.utime = stage.Now();
    forger.Commands();
    REQUIRE(stage.WaitUntil([&] { return !launch.running(); }, kLong));
    CHECK_THAT(launch.Tail(20), Contains("two speak on JOINT_COMMAND: process ") &&
                                    Contains("(plumb-controller) and somebody who does not say"));
    CHECK(stage.axis_state == kIdle);
  }
  INFO(launch.Tail(20));
  CHECK(launch.ending() == "exit status 1");
  CHECK_FALSE(fs::exists(stage.folder / "summary.json"));
  CHECK(stage.axis_state != kRunning);
  CHECK(stage.torque == 0);
  CHECK(Left(stage) == 0);
}

TEST_CASE("in real time a run with a key does not notice what others say") {
  Stage stage(14, "pendulum", Stage::Time::kReal);
  LearnLittle(stage);
  const fs::path summary_file = stage.folder / "summary.json", key = stage.folder / "key";
  MakeKeyFile(key);
  std::vector<std::string> flags = Short(summary_file);
  flags.insert(flags.end(), {"--key", key});
  Child launch = Launch(stage, flags);
  Forger forger(stage.messenger);
  int64_t last = 0;
  REQUIRE(stage.WaitUntil(
      [&] {
        forger.utime = stage.Now();
        if (stage.drivers.received() > 0 && stage.Now() - last > 500'000) {
          last = stage.Now();
          forger.Finished(1);
          forger.JointState(1e308);
          forger.Commands();
        }
        return !launch.running();
      },
      kLong));
  INFO(launch.Tail(30));
  REQUIRE_FALSE(launch.failed());
  const auto summary = nlohmann::json::parse(Read(summary_file));
  REQUIRE(summary.at("iterations").size() == 1);
  CHECK(summary.at("iterations")[0].at("transitions") >= 150);
  CHECK(summary.at("iterations")[0].at("mean")[0] != 47);
  CHECK(summary.at("evaluation_returns")[0] != 4711);
}

TEST_CASE("a request is done when the driver has answered it, and else it has failed") {
  Stage stage(15, "pendulum", Stage::Time::kReal);
  Publisher<driver_status_t> statuses(stage.messenger, "DRIVER_STATUS");
  driver_status_t status{};
  const auto ask = [&](const char* what, bool somebody_else_says_idle) {
    Child request("plumb", {Stage::Binary("plumb"), what, "--lcm-url", stage.lcm_url},
                  stage.folder / (std::string(what) + ".log"));
    REQUIRE(stage.WaitUntil(
        [&] {
          status.state = driver_status_t::IDLE;
          status.utime = stage.Now();
          if (somebody_else_says_idle) statuses.Publish(status);
          return !request.running();
        },
        kLong));
    CHECK(request.ending() == "exit status 1");
    const std::string said = request.Tail(5);
    fs::remove(stage.folder / (std::string(what) + ".log"));
    return said;
  };
  for (const char* what : {"disarm", "estop", "arm"}) {
    INFO(what);
    CHECK_THAT(ask(what, false), Contains("no driver answers on " + stage.lcm_url));
    CHECK_THAT(ask(what, true), Contains("it has not answered this request"));
  }
}

}  // namespace
}  // namespace plumb
