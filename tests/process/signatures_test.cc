// Signed commands, with real processes: a loop that signs moves the robot, and nobody else does; stopping
// needs no key.

#include <algorithm>
#include <cmath>

#include "tests/process/stage.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Catch::Contains;
using Catch::StartsWith;

constexpr int kIdle = 1;  // CANSimple axis state

/// Runs one of our programs to its end. @return its output.
std::string Output(Stage& stage, std::vector<std::string> arguments, bool fails) {
  const fs::path log = stage.folder / "output.log";
  fs::remove(log);
  arguments[0] = Stage::Binary(arguments[0]);
  Child child("program", arguments, log);
  REQUIRE(child.WaitFor(10));
  INFO(child.Tail(50));
  CHECK(child.failed() == fails);
  return child.Tail(50);
}

/// Somebody without the key, who has seen what a command looks like.
struct Stranger {
  explicit Stranger(Stage& s)
      : stage(s), commands(s.messenger, "JOINT_COMMAND"), requests(s.messenger, "DRIVER_REQUEST") {}
  void Command() {
    joint_command_t command =
        stage.commands.received() > 0 ? stage.commands.newest() : joint_command_t{};  // its signature, too
    command.utime = Stage::RealUtime();
    command.counter = Stage::RealUtime();
    command.sequence += 1000;
    command.num_joints = 1;
    command.effort = {stage.robot.joints[0].effort_limit};
    command.position = command.velocity = command.kp = command.kd = {NAN};
    commands.Publish(command);
  }
  void Request(int8_t what) {
    driver_request_t request{};
    request.utime = request.counter = Stage::RealUtime();
    request.request = what;
    requests.Publish(request);
  }
  Stage& stage;
  Publisher<joint_command_t> commands;
  Publisher<driver_request_t> requests;
};

/// Everything signed that was said on the two channels, byte for byte.
struct Recorder {
  struct Message {
    std::string channel;
    std::vector<uint8_t> bytes;
  };
  explicit Recorder(Stage& stage) {
    stage.messenger.lcm().subscribe("JOINT_COMMAND", &Recorder::On, this)->setQueueCapacity(0);
    stage.messenger.lcm().subscribe("DRIVER_REQUEST", &Recorder::On, this)->setQueueCapacity(0);
  }
  void On(const lcm::ReceiveBuffer* buffer, const std::string& channel) {
    const auto* bytes = static_cast<const uint8_t*>(buffer->data);
    if (recording) messages.push_back({channel, {bytes, bytes + buffer->data_size}});
  }
  bool recording = true;
  std::vector<Message> messages;
};

TEST_CASE("a signed loop moves the robot, a stranger does not, and stopping needs no key") {
  Stage stage(80);
  const fs::path key = stage.UseKey();
  stage.RunWithTorque();
  CHECK(stage.drivers.newest().commands_signed);
  CHECK(stage.drivers.newest().commands_forged == 0);
  Stranger stranger(stage);

  // The policy asks for half the greatest effort, the stranger for all of it.
  const auto greatest = static_cast<float>(stage.robot.joints[0].effort_limit);
  float seen = 0;
  for (int i = 0; i < 50; ++i) {
    stranger.Command();
    stage.WaitUntil(
        [&] {
          seen = std::max(seen, std::abs(stage.torque));
          return false;
        },
        0.01);
  }
  CHECK(stage.WaitUntil([&] { return stage.drivers.newest().commands_forged == 50; }, 2));
  CHECK(seen > 0);
  CHECK(seen < 0.9f * greatest);
  CHECK(stage.drivers.newest().state == driver_status_t::ARMED);
  CHECK_THAT(
      Output(stage, {"plumb", "doctor", "--bus", stage.bus_url, "--lcm-url", stage.lcm_url, "--key", key},
             false),
      Contains("commands are signed: " + key.string()) &&
          Contains("obeys signed commands only, and has dropped 50"));

  // Whoever wants to stop it may.
  stranger.Request(driver_request_t::DISARM);
  REQUIRE(stage.WaitUntil([&] { return stage.axis_state == kIdle; }, 2));
  CHECK(stage.WaitForDriver(driver_status_t::IDLE, 2));
  CHECK(stage.drivers.newest().reason == "disarmed on request");
  // And nobody else starts it again.
  stranger.Request(driver_request_t::ARM);
  REQUIRE(stage.WaitUntil([&] { return stage.drivers.newest().commands_forged == 51; }, 2));
  CHECK(stage.drivers.newest().reason ==
        "disarmed on request; ARM refused: not signed with the driver's key");
  CHECK_THAT(Output(stage, {"plumb", "arm", "--lcm-url", stage.lcm_url}, true), Contains("--key FILE"));
  stage.Listen(0.3);
  CHECK(stage.axis_state == kIdle);
  CHECK_THAT(Output(stage, {"plumb", "arm", "--lcm-url", stage.lcm_url, "--key", key}, false),
             Contains("armed"));
  REQUIRE(stage.WaitForDriver(driver_status_t::ARMED, 2));

  // Alone, the stranger is heard and not obeyed, and the driver says so.
  stage.children.at("plumb-controller")->Signal(SIGSTOP);
  const auto refused = [&] { return stage.drivers.newest().reason.rfind("commands refused", 0) == 0; };
  for (int attempt = 0; attempt < 5 && !refused(); ++attempt) {  // a busy machine stops it for other reasons, too
    REQUIRE(stage.Arm());
    REQUIRE(stage.WaitUntil(
        [&] {
          stranger.Command();
          return stage.drivers.newest().state == driver_status_t::FAULT;
        },
        5));
  }
  CHECK_THAT(stage.drivers.newest().reason, StartsWith("commands refused: not signed with the driver's key"));
  stage.children.at("plumb-controller")->Signal(SIGCONT);
  REQUIRE(stage.Arm());
  CHECK_THAT(Output(stage, {"plumb", "estop", "--lcm-url", stage.lcm_url}, false),
             Contains("emergency stop requested"));
  CHECK(stage.WaitUntil([&] { return stage.axis_state == kIdle; }, 2));
}

TEST_CASE("what was recorded is worth nothing, to the same driver and to one that is started again") {
  Stage stage(81);
  stage.UseKey();
  Recorder recorder(stage);
  stage.RunWithTorque();
  REQUIRE(stage.WaitUntil([&] { return recorder.messages.size() > 20; }, 10));
  recorder.recording = false;
  REQUIRE(recorder.messages.front().channel == "DRIVER_REQUEST");
  const auto replay = [&] {
    for (const Recorder::Message& message : recorder.messages) {
      stage.messenger.lcm().publish(message.channel, message.bytes.data(),
                                    static_cast<unsigned>(message.bytes.size()));
      stage.Listen(0.005);
    }
    stage.Listen(0.3);
  };
  const auto forged = static_cast<int64_t>(recorder.messages.size());

  stage.children.erase("plumb-controller");
  REQUIRE(stage.WaitForDriver(driver_status_t::FAULT, 5));
  REQUIRE(stage.WaitUntil([&] { return stage.axis_state == kIdle; }, 2));
  const int64_t torque = stage.last_torque_time;
  replay();
  CHECK(stage.drivers.newest().state == driver_status_t::FAULT);
  CHECK(stage.drivers.newest().commands_forged == forged);

  stage.children.erase("plumb-driver");
  stage.StartDriver();
  REQUIRE(stage.WaitUntil([&] { return stage.drivers.newest().commands_forged == 0; }, 5));
  REQUIRE(stage.WaitForDriver(driver_status_t::IDLE, 5));
  replay();
  CHECK(stage.drivers.newest().state == driver_status_t::IDLE);
  CHECK(stage.drivers.newest().commands_forged == forged);
  CHECK_THAT(
      stage.drivers.newest().reason,
      Contains("ARM refused") && Contains("signed, but a repetition, or from before the driver's start"));
  // Nor when a person arms.
  REQUIRE(stage.Arm());
  replay();
  CHECK(stage.drivers.newest().commands_forged == 2 * forged);
  CHECK(stage.drivers.newest().state == driver_status_t::FAULT);
  CHECK_THAT(stage.drivers.newest().reason, Contains("commands refused: signed, but a repetition"));
  CHECK(stage.last_torque_time == torque);
}

TEST_CASE("a driver that others could command does not start without a key") {
  Stage stage(82);
  const std::string open = "udpm://239.255.76.67:17782?ttl=1";
  for (const std::vector<std::string>& program :
       {std::vector<std::string>{"plumb-driver", stage.robot_folder, "--bus", stage.bus_url},
        std::vector<std::string>{"plumb", "launch", stage.robot_folder, "--bus", stage.bus_url, "--output",
                                 stage.folder / "run"}}) {
    std::vector<std::string> arguments = program;
    arguments.insert(arguments.end(), {"--lcm-url", open});
    const std::string output = Output(stage, arguments, true);
    INFO(output);
    CHECK(std::count(output.begin(), output.end(), '\n') == 1);
    CHECK_THAT(output,
               Contains(open + " leaves this machine") && Contains("--key FILE") && Contains("--unsigned"));
  }
  // Allowed: it gets as far as opening LCM, at an address where nobody is.
  CHECK_THAT(Output(stage,
                    {"plumb-driver", stage.robot_folder, "--bus", stage.bus_url, "--lcm-url",
                     "tcpq://127.0.0.1:1", "--unsigned"},
                    true),
             Contains("cannot open LCM"));
  const fs::path key = stage.UseKey();
  fs::permissions(key, fs::perms::group_read, fs::perm_options::add);
  for (const char* program : {"plumb-driver", "plumb-controller"}) {
    const std::string output =
        Output(stage, {program, stage.robot_folder, "--lcm-url", stage.lcm_url, "--key", key}, true);
    CHECK_THAT(output, Contains("mode 0640") && Contains("chmod 600 " + key.string()));
  }
  CHECK_THAT(Output(stage, {"plumb-driver", stage.robot_folder, "--key", key, "--unsigned"}, true),
             Contains("excludes"));
}

}  // namespace
}  // namespace plumb
