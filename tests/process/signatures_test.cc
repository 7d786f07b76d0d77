// Signed commands, with real processes: a loop that signs moves the robot, and nobody else does;
// stopping needs no key.

#include <algorithm>
#include <cmath>

#include "common/message_bytes.h"
#include "tests/process/stage.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Catch::Contains;
using Catch::StartsWith;

constexpr int kIdle = 1;  // CANSimple axis state

/// Runs one of our programs to its end, outside the run. @return its output.
std::string Output(Stage& stage, std::vector<std::string> arguments, bool fails) {
  const fs::path log = stage.folder / "output.log";
  fs::remove(log);
  arguments[0] = Stage::Binary(arguments[0]);
  Child child("program", arguments, log);
  REQUIRE(child.WaitFor(60));
  INFO(child.Tail(50));
  CHECK(child.failed() == fails);
  return child.Tail(50);
}
/// Runs plumb in the run. @return its output.
std::string InTheRun(Stage& stage, std::vector<std::string> arguments, bool fails) {
  const fs::path log = stage.folder / "output.log";
  fs::remove(log);
  arguments.insert(arguments.begin(), Stage::Binary("plumb"));
  arguments.insert(arguments.end(), {"--clock", stage.coordinator->clock()});
  Child child("plumb", arguments, log);
  stage.coordinator->Expect("plumb", child.pid());
  REQUIRE(stage.WaitUntil([&] { return !stage.coordinator->present("plumb"); }, 10));
  REQUIRE(child.WaitFor(60));
  INFO(child.Tail(50));
  CHECK(child.failed() == fails);
  return child.Tail(50);
}

/// Somebody without the key, who has seen what is said, and copies its seals.
struct Stranger {
  explicit Stranger(Stage& s) : stage(s) {
    stage.coordinator->on_post = [this](const lockstep_post_t& post, const std::string&) {
      if (const std::optional<Seal> seal = FindSeal(post.data)) seen[post.topic.name] = *seal;
    };
  }
  ~Stranger() {
    stage.coordinator->on_post = [](const auto&, const auto&) {};
  }
  template <class Message>
  void Say(const std::string& channel, const Message& message) {
    std::vector<uint8_t> bytes = Encode(message);
    bytes.resize(bytes.size() + kSealSize);
    Seal seal = seen[channel];
    seal.counter = stage.Now();
    WriteSeal(seal, nullptr, "", "", "", bytes);  // its signature, too
    stage.messenger.Publish(channel, bytes);
  }
  void Command() {
    joint_command_t command{};
    if (stage.commands.received() > 0) command = stage.commands.newest();
    command.utime = stage.Now();
    command.sequence += 1000;
    command.num_joints = 1;
    command.effort = {stage.robot.joints[0].effort_limit};
    command.position = command.velocity = command.kp = command.kd = {NAN};
    Say("JOINT_COMMAND", command);
  }
  void Request(int8_t what) {
    driver_request_t request{};
    request.utime = stage.Now();
    request.request = what;
    Say("DRIVER_REQUEST", request);
  }
  Stage& stage;
  std::map<std::string, Seal> seen;  // the newest one of each channel
};

/// Everything signed that was said on the two channels, byte for byte.
struct Recorder {
  struct Message {
    std::string channel;
    std::vector<uint8_t> bytes;
  };
  explicit Recorder(Stage& stage) {
    stage.coordinator->on_post = [this](const lockstep_post_t& post, const std::string&) {
      const std::string& channel = post.topic.name;
      if (recording && (channel == "JOINT_COMMAND" || channel == "DRIVER_REQUEST"))
        messages.push_back({channel, post.data});
    };
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
  // Whoever wants to stop it may.
  stranger.Request(driver_request_t::DISARM);
  REQUIRE(stage.WaitUntil([&] { return stage.axis_state == kIdle; }, 2));
  CHECK(stage.WaitForDriver(driver_status_t::IDLE, 2));
  CHECK(stage.drivers.newest().reason == "disarmed on request");
  // And nobody else starts it again.
  stranger.Request(driver_request_t::ARM);
  REQUIRE(stage.WaitUntil([&] { return stage.drivers.newest().commands_forged == 51; }, 2));
  CHECK(stage.drivers.newest().reason ==
        "disarmed on request; ARM refused: not signed with the driver's key, for its robot and its "
        "bus");
  CHECK_THAT(InTheRun(stage, {"arm"}, true), Contains("--key FILE"));
  stage.Listen(0.3);
  CHECK(stage.axis_state == kIdle);
  CHECK_THAT(InTheRun(stage, {"arm", "--key", key}, false), Contains("armed"));
  REQUIRE(stage.WaitForDriver(driver_status_t::ARMED, 2));

  // Alone, the stranger is heard and not obeyed, and the driver says so.
  stage.Stall("plumb-controller", 2);
  for (int i = 0; i < 1000 && stage.drivers.newest().state != driver_status_t::FAULT; ++i) {
    stranger.Command();
    stage.Listen(0.005);
  }
  REQUIRE(stage.drivers.newest().state == driver_status_t::FAULT);
  CHECK_THAT(stage.drivers.newest().reason,
             StartsWith("commands refused: not signed with the driver's key"));
  stage.Listen(2);
  REQUIRE(stage.Arm());
  CHECK_THAT(InTheRun(stage, {"estop"}, false), Contains("emergency stop requested"));
  CHECK(stage.WaitUntil([&] { return stage.axis_state == kIdle; }, 2));
}

TEST_CASE(
    "what was recorded is worth nothing, to the same driver and to one that is started again") {
  Stage stage(81);
  stage.UseKey();
  Recorder recorder(stage);
  stage.RunWithTorque();
  REQUIRE(stage.WaitUntil([&] { return recorder.messages.size() > 20; }, 10));
  recorder.recording = false;
  REQUIRE(recorder.messages.front().channel == "DRIVER_REQUEST");
  const auto replay = [&] {
    for (const Recorder::Message& message : recorder.messages) {
      stage.messenger.Publish(message.channel, message.bytes);
      stage.Listen(0.005);
    }
    stage.Listen(0.3);
  };
  const auto forged = static_cast<int64_t>(recorder.messages.size());

  stage.Kill("plumb-controller");
  REQUIRE(stage.WaitForDriver(driver_status_t::FAULT, 5));
  REQUIRE(stage.WaitUntil([&] { return stage.axis_state == kIdle; }, 2));
  const int64_t torque = stage.last_torque_time;
  replay();
  CHECK(stage.drivers.newest().state == driver_status_t::FAULT);
  CHECK(stage.drivers.newest().commands_forged == forged);

  stage.Kill("plumb-driver");
  stage.StartDriver();
  REQUIRE(stage.WaitUntil([&] { return stage.drivers.newest().commands_forged == 0; }, 5));
  REQUIRE(stage.WaitForDriver(driver_status_t::IDLE, 5));
  replay();
  CHECK(stage.drivers.newest().state == driver_status_t::IDLE);
  CHECK(stage.drivers.newest().commands_forged == forged);
  CHECK_THAT(stage.drivers.newest().reason,
             Contains("ARM refused") && Contains("signed for another run of the driver"));
  // Nor when a person arms.
  REQUIRE(stage.Arm());
  replay();
  CHECK(stage.drivers.newest().commands_forged == 2 * forged);
  CHECK(stage.drivers.newest().state == driver_status_t::FAULT);
  CHECK_THAT(stage.drivers.newest().reason,
             Contains("commands refused: signed for another run of the driver"));
  CHECK(stage.last_torque_time == torque);
}

TEST_CASE("a driver that others could command does not start without a key") {
  Stage stage(82);
  const std::string open = "udpm://239.255.76.67:17782?ttl=1";
  for (const std::vector<std::string>& program :
       {std::vector<std::string>{"plumb-driver", stage.robot_folder, "--bus", stage.bus_url},
        std::vector<std::string>{"plumb", "launch", stage.robot_folder, "--bus", stage.bus_url,
                                 "--output", stage.folder / "run"}}) {
    std::vector<std::string> arguments = program;
    arguments.insert(arguments.end(), {"--lcm-url", open});
    const std::string output = Output(stage, arguments, true);
    INFO(output);
    CHECK(std::count(output.begin(), output.end(), '\n') == 1);
    CHECK_THAT(output, Contains(open + " leaves this machine") && Contains("--key FILE") &&
                           Contains("--unsigned"));
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
    const std::string output = Output(
        stage, {program, stage.robot_folder, "--lcm-url", stage.lcm_url, "--key", key}, true);
    CHECK_THAT(output, Contains("mode 0640") && Contains("chmod 600 " + key.string()));
  }
  CHECK_THAT(Output(stage, {"plumb-driver", stage.robot_folder, "--key", key, "--unsigned"}, true),
             Contains("excludes"));
}

}  // namespace
}  // namespace plumb
