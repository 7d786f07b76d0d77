// A flood of well-formed messages on LCM's group: whoever must stop stops, and nobody's memory
// grows beyond what docs/security.md says. In real time: datagrams have no other.

#include <cmath>

#include "controller/policy.h"
#include "plumb/calibration_status_t.hpp"
#include "plumb/imu_t.hpp"
#include "plumb/joint_state_t.hpp"
#include "plumb/parameter_distribution_t.hpp"
#include "plumb/place_robot_t.hpp"
#include "plumb/training_status_t.hpp"
#include "robot/parameter_distribution.h"
#include "tests/process/flood.h"
#include "tests/process/launch.h"

namespace plumb {
namespace {

using Catch::Contains;

/// One of each that the processes say to each other, plausible but for who says it. Without a key
/// whoever speaks on DRIVER_STATUS beside the driver ends `plumb arm`, and the first request to arm
/// is obeyed, whoever it comes from: neither is sent then.
std::vector<std::vector<uint8_t>> OneOfEach(const Stage& stage, bool with_key) {
  joint_state_t measured{};
  measured.utime = stage.Now(), measured.num_joints = 1;
  measured.measured = {stage.Now()};
  measured.position = measured.velocity = {0};
  measured.effort_measured = measured.effort_sent = measured.effort_applied = {0};
  measured.valid = {1};
  robot_state_t state{};
  state.utime = stage.Now(), state.num_positions = state.num_velocities = 1, state.valid = 1;
  state.q = state.v = state.effort = {0};
  state.q_sd = state.v_sd = {1e-3};
  joint_command_t command{};
  command.utime = stage.Now(), command.num_joints = 1;
  command.effort = {1};
  command.position = command.velocity = command.kp = command.kd = {NAN};
  policy_t policy = GaussianPolicy(PolicyShape{3, {4}, 1}).ToMessage();
  place_robot_t place{};
  place.num_positions = place.num_velocities = 1, place.q = place.v = {0};
  driver_request_t request{};
  request.utime = stage.Now();
  request.request = with_key ? driver_request_t::ARM : int8_t{77};
  std::vector<std::vector<uint8_t>> all{
      Said("JOINT_STATE", measured),
      Said("IMU", imu_t{}),
      Said("ROBOT_STATE", state),
      Said("ROBOT_STATE_SMOOTHED", state),
      Said("JOINT_COMMAND", command),
      Said("POLICY", policy),
      Said("PLACE_ROBOT", place),
      Said("DRIVER_REQUEST", request),
      Said("CONTROLLER_STATUS", controller_status_t{}),
      Said("CALIBRATION_STATUS", calibration_status_t{}),
      Said("TRAINING_STATUS", training_status_t{}),
      Said("PARAMETER_DISTRIBUTION", ParameterDistribution::Prior(stage.robot).ToMessage())};
  driver_status_t status{};
  status.utime = stage.Now(), status.state = driver_status_t::ARMED;
  if (with_key) all.push_back(Said("DRIVER_STATUS", status));
  return all;
}

TEST_CASE("disarm and estop reach the driver through a flood of well-formed messages") {
  const bool with_key = GENERATE(false, true);
  INFO((with_key ? "with" : "without") << " a key");
  Stage stage(96, "pendulum", Stage::Time::kReal);
  std::vector<std::string> key;
  if (with_key) key = {"--key", stage.UseKey()};
  stage.StartRobotAndDriver();
  REQUIRE(stage.Arm(kLong));  // commands at the driver's start would be a left-over controller's
  const Flood flood(stage.lcm_url, OneOfEach(stage, with_key), 10'000);
  const auto flooded = [&] { return stage.commands.received() + stage.commands.refused(); };
  REQUIRE(stage.WaitUntil([&] { return flooded() > 1000; }, kLong));
  for (const char* stop : {"disarm", "estop", "disarm", "estop"}) {
    const int64_t before = flooded();
    REQUIRE(stage.Arm(kLong));
    REQUIRE_FALSE(stage.drivers.newest().stopped_by_request);
    std::vector<std::string> arguments{Stage::Binary("plumb"), stop, "--lcm-url", stage.lcm_url};
    arguments.insert(arguments.end(), key.begin(), key.end());
    Child request("plumb", arguments, stage.folder / "stop.log");
    CHECK(stage.WaitUntil([&] { return stage.drivers.newest().stopped_by_request; }, kLong));
    REQUIRE(stage.WaitUntil([&] { return !request.running(); }, kLong));
    INFO(stop << ": " << request.ending() << ": " << request.Tail(5));
    CHECK_FALSE(request.failed());
    CHECK(stage.WaitUntil([&] { return stage.axis_state == 1; }, kLong));
    CHECK(flooded() > before);
  }
  if (with_key)
    CHECK(stage.WaitUntil([&] { return stage.drivers.newest().commands_forged > 1000; }, kLong));
}

TEST_CASE("an estop reaches the driver though others speak in the driver's name, without a key") {
  Stage stage(99, "pendulum", Stage::Time::kReal);
  stage.StartRobotAndDriver();
  REQUIRE(stage.WaitUntil([&] { return stage.drivers.received() > 0; }, kLong));
  driver_status_t status{};
  status.utime = stage.Now(), status.state = driver_status_t::IDLE;
  const Flood flood(stage.lcm_url, {Said("DRIVER_STATUS", status)}, 10'000);
  REQUIRE(stage.WaitUntil([&] { return stage.drivers.received() > 1000; }, kLong));
  Child request("plumb", {Stage::Binary("plumb"), "estop", "--lcm-url", stage.lcm_url},
                stage.folder / "stop.log");
  constexpr uint32_t kEstop = 0x022;  // CANSimple, node 1
  CHECK(stage.WaitUntil([&] { return stage.frames_by_id[kEstop] > 0; }, kLong));
  REQUIRE(stage.WaitUntil([&] { return !request.running(); }, kLong));
  INFO(request.ending() << ": " << request.Tail(5));
  CHECK_FALSE(request.failed());  // the driver's answer to it is found among the others
}

TEST_CASE("disarm and estop end a run in virtual time through such a flood") {
  const char* stop = GENERATE("disarm", "estop");
  Stage stage(97, "pendulum", Stage::Time::kReal);
  const std::string can_log = stage.folder / "can.log";
  Child launch = Launch(stage, {"--can-log", can_log});
  REQUIRE(stage.WaitForDriver(driver_status_t::ARMED, kLong));
  const Flood flood(stage.lcm_url, OneOfEach(stage, false), 10'000);
  Child request("plumb", {Stage::Binary("plumb"), stop, "--lcm-url", stage.lcm_url},
                stage.folder / "stop.log");
  REQUIRE(stage.WaitUntil([&] { return !launch.running(); }, kLong));
  INFO(launch.Tail(20));
  CHECK(launch.ending() == "exit status 1");
  CHECK_THAT(launch.Tail(5), Contains("somebody outside the run has asked for a stop"));
  CHECK(LastFrame(can_log, "021").substr(8, 2) == "01");
  CHECK(Left(stage) <= 1);  // the request, which waits for its answer
}

TEST_CASE("the trainer's memory has a bound while it trains") {
  Stage stage(98, "pendulum", Stage::Time::kReal);
  const std::filesystem::path file = stage.folder / "robot.toml";
  // An update takes seconds, in which nothing is taken out of the queues.
  std::ofstream(file) << "extends = \"" << stage.robot_folder << "/robot.toml\"\n[robot]\nurdf = \""
                      << stage.robot_folder << "/robot.urdf\"\n[training]\nbatch = 60000\n";
  stage.robot_folder = file;
  stage.UseKey();  // without one the second speaker would end the trainer
  stage.StartRobotAndDriver();
  Subscriber<training_status_t> trainings(stage.messenger, "TRAINING_STATUS");
  Publisher<parameter_distribution_t> distributions(stage.messenger, "PARAMETER_DISTRIBUTION");
  Child& trainer = stage.Start("plumb-trainer", {"--threads", "1"});
  parameter_distribution_t prior = ParameterDistribution::Prior(LoadRobot(file)).ToMessage();
  int64_t said = 0;
  REQUIRE(stage.WaitUntil(
      [&] {
        if (stage.Now() - said > 500'000) said = stage.Now(), distributions.Publish(prior);
        return trainings.received() > 0 && trainings.newest().update >= 1;
      },
      kLong));
  REQUIRE(trainer.running());
  const int64_t before = MostMemory(trainer);
  REQUIRE(before > 0);
  prior.num_starts = 12'000, prior.start.assign(12'000, 0.5f);
  controller_status_t status{};
  status.num_episodes = 1000;
  status.episode = status.first_state_sequence = status.last_state_sequence =
      std::vector<int64_t>(1000, 1);
  status.returns = status.late_rate = std::vector<double>(1000, 1);
  status.steps = std::vector<int32_t>(1000, 200);
  status.fell = std::vector<int8_t>(1000, 0);
  const std::vector<uint8_t> a = Said("PARAMETER_DISTRIBUTION", prior),
                             b = Said("CONTROLLER_STATUS", status);
  const MulticastAddress group = ParseUdpm(stage.lcm_url);
  const RawSender sender(group.group, group.port);
  const int update = trainings.newest().update;
  size_t bytes = 0;
  // Until it has looked again, and has told what it has lost of both.
  const auto lost = [&](const std::string& channel) {
    return Read(trainer.log()).find(channel + ": ") != std::string::npos &&
           Read(trainer.log()).find("messages lost") != std::string::npos;
  };
  while (trainings.newest().update < update + 2) {
    REQUIRE(trainer.running());
    for (int i = 0; i < 200; ++i) {
      sender.Send(a), sender.Send(b);
      bytes += a.size() + b.size();
    }
    stage.Listen(0.001);
  }
  const int64_t grown = MostMemory(trainer) - before;
  INFO(bytes / 1'000'000 << " MB were sent, the trainer grew by " << grown / 1000 << " MB");
  CHECK(bytes > size_t{400'000'000});
  CHECK(lost("PARAMETER_DISTRIBUTION"));
  CHECK(lost("CONTROLLER_STATUS"));
#if !defined(__SANITIZE_THREAD__) && !defined(__SANITIZE_ADDRESS__)  // whose own memory counts
  // Two queues of 32 MB, and what the allocator keeps of them.
  CHECK(grown < 100'000);
#endif
  CHECK(trainer.running());
}

}  // namespace
}  // namespace plumb
