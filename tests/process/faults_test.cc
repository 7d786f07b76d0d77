// Faults must never hurt anybody, with real processes: whatever dies, stops or talks rubbish, the
// torque goes to zero within the configured time, the drive is disarmed, the driver says why, and
// only a deliberate request re-arms.

#include <cmath>
#include <cstring>
#include <fstream>

#include "common/random.h"
#include "common/time_units.h"
#include "tests/process/stage.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr int kClosedLoop = 8, kIdle = 1;  // CANSimple axis states
constexpr int64_t kTick = 10'000;          // [us] in which plumb-controller looks at its clock

int64_t Cycle(const Stage& stage) { return Microseconds(stage.robot.driver.cycle); }

// After the event: the last torque comes no later than `most` [us] after `since`, the drive is
// idle, the driver in FAULT with a reason.
void ExpectSafe(Stage& stage, int64_t since, int64_t most) {
  REQUIRE(stage.WaitForDriver(driver_status_t::FAULT, 5));
  CHECK_FALSE(stage.drivers.newest().reason.empty());
  REQUIRE(stage.WaitUntil([&] { return stage.axis_state == kIdle; }, 2));
  INFO(stage.drivers.newest().reason << "; last torque " << stage.last_torque_time - since
                                     << " us after the event");
  CHECK(stage.last_torque_time - since <= most);
  // It stays so, although everything that was well still is.
  const int64_t last_torque = stage.last_torque_time;
  stage.Listen(1);
  CHECK(stage.last_torque_time == last_torque);
  CHECK(stage.drivers.newest().state == driver_status_t::FAULT);
}

void ExpectComesBackByArming(Stage& stage) {
  CHECK(stage.BeginEpisode());
  CHECK(stage.axis_state == kClosedLoop);
}

TEST_CASE("a killed estimator") {
  Stage stage(1);
  stage.RunWithTorque();
  stage.Kill("plumb-estimator");
  REQUIRE(stage.WaitUntil(
      [&] { return stage.controllers.newest().phase == controller_status_t::HALTED; }, 3));
  const int64_t timeout = Microseconds(stage.robot.controller.state_timeout);
  CHECK(stage.Now() - stage.last_state > timeout);
  CHECK(stage.Now() - stage.last_state <= timeout + kTick);
  CHECK_THAT(stage.controllers.newest().reason, Catch::Contains("no valid state"));
  ExpectSafe(stage, stage.last_state, timeout + kTick);
  stage.Start("plumb-estimator");
  ExpectComesBackByArming(stage);
}

TEST_CASE("a controller that stands still") {
  Stage stage(2);
  stage.RunWithTorque();
  stage.Stall("plumb-controller", 0.5);
  stage.Listen(0.1);
  const int64_t expiry = Microseconds(stage.robot.driver.expiry), last_command = stage.last_command;
  ExpectSafe(stage, last_command, expiry);
  CHECK(stage.last_torque_time - last_command >= expiry - Cycle(stage));  // and not earlier, either
  CHECK_THAT(stage.drivers.newest().reason, Catch::Contains("command"));
  // The frames before it are on disk, the reason above them, the last torques among them.
  std::vector<fs::path> records;
  REQUIRE(AwaitReally([&] {  // the disk takes its own time
    records.assign(fs::directory_iterator(stage.folder / "faults"), {});
    return records.size() == 1 && records[0].extension() == ".log";
  }));
  const std::string record = Read(records[0]);
  CHECK(record.rfind("# no command for", 0) == 0);
  CHECK(record.find(" 02E#00000000 T\n") != std::string::npos);
  CHECK(record.find(" R\n") != std::string::npos);
  // It has woken up meanwhile, with old states in its hands; that alone has moved nothing.
  CHECK(stage.last_command > stage.last_torque_time);
  CHECK(stage.axis_state == kIdle);
  ExpectComesBackByArming(stage);
}

TEST_CASE("a killed driver: the drive's own watchdog ends it") {
  Stage stage(3);
  stage.RunWithTorque();
  const int64_t killed = stage.Now();
  stage.Kill("plumb-driver");
  REQUIRE(stage.WaitUntil([&] { return stage.axis_state == kIdle; }, 5));
  CHECK(stage.last_torque_time <= killed);
  const int64_t watchdog = Microseconds(stage.robot.virtual_robot.watchdog),
                heartbeat = Microseconds(stage.robot.virtual_robot.heartbeat);
  CHECK(stage.Now() - stage.last_torque_time >= watchdog);
  CHECK(stage.Now() - stage.last_torque_time <= watchdog + heartbeat);
  // A driver that is started beside a running controller does not arm, and takes no old command for
  // a new one.
  stage.Start("plumb-driver", {"--bus", stage.bus_url, "--virtual"});
  stage.Listen(1.5);
  CHECK(stage.axis_state == kIdle);
  CHECK(stage.last_torque_time <= killed);
  ExpectComesBackByArming(stage);
}

TEST_CASE("a driver that stands still: the watchdog ends it, and it wakes up disarmed") {
  Stage stage(4);
  stage.RunWithTorque();
  const int64_t stalled = stage.Now();
  stage.Stall("plumb-driver", 0.3);
  REQUIRE(stage.WaitUntil([&] { return stage.axis_state == kIdle; }, 5));
  CHECK(stage.Now() < stalled + Microseconds(0.3));
  REQUIRE(stage.WaitForDriver(driver_status_t::FAULT, 5));
  CHECK(stage.Now() == stalled + Microseconds(0.3));  // in its first cycle
  stage.Listen(0.5);
  CHECK(stage.last_torque_time <= stalled);
  CHECK(stage.axis_state == kIdle);
  ExpectComesBackByArming(stage);
}

TEST_CASE("a drive that disappears") {
  Stage stage(5);
  stage.RunWithTorque();
  stage.Kill("plumb-robot");
  const int64_t gone = stage.last_state, stale = Microseconds(stage.robot.driver.stale_after);
  REQUIRE(stage.WaitForDriver(driver_status_t::FAULT, 5));
  CHECK(stage.Now() - gone > stale);
  CHECK(stage.Now() - gone <= stale + Cycle(stage));
  stage.Listen(0.5);
  INFO(stage.drivers.newest().reason);
  CHECK(stage.last_torque_time - gone <= stale);
  CHECK_THAT(stage.drivers.newest().reason, Catch::Contains("pivot"));
  stage.Start("plumb-robot", {"--bus", stage.bus_url, "--seed", "1"});
  stage.Listen(1);
  CHECK(stage.axis_state == kIdle);
  ExpectComesBackByArming(stage);
}

TEST_CASE("garbage on the bus") {
  Stage stage(6);
  stage.RunWithTorque();
  Random random(1);
  const int64_t rejected = stage.drivers.newest().buses[0].frames_rejected;
  const auto send = [&](const Frame& frame) { stage.bus->Send({&frame, 1}); };
  // Short and not-a-number encoder frames of the very drive, and random frames; not what is
  // well-formed and means something (a real heartbeat of the drive's own id would be a second
  // drive, a real Estop an emergency stop).
  for (int round = 0; round < 40; ++round) {
    send(*FrameFromText("029#000080BE"));
    send(*FrameFromText("029#0000C07F00006040"));
    send(*FrameFromText("029#0000807F00006040"));
    for (int i = 0; i < 20; ++i) {
      Frame frame;
      frame.extended = random.Bits() % 4 == 0;
      frame.remote = random.Bits() % 8 == 0;
      frame.id = random.Bits() & (frame.extended ? 0x1fffffffu : 0x7ffu);
      if (!frame.extended && (frame.id >> 5 == 1 || frame.id >> 5 == 0x3f)) continue;
      frame.length = static_cast<uint8_t>(random.Bits() % 9);
      for (int k = 0; k < frame.length; ++k)
        frame.data[static_cast<size_t>(k)] = static_cast<uint8_t>(random.Bits());
      send(frame);
    }
    stage.Listen(0.01);
  }
  stage.Listen(0.5);
  CHECK(stage.drivers.newest().state == driver_status_t::ARMED);
  CHECK(stage.drivers.newest().buses[0].frames_rejected >= rejected + 100);
  CHECK(stage.children.at("plumb-driver")->running());
  CHECK(stage.children.at("plumb-robot")->running());
  CHECK(std::isfinite(stage.states.newest().q[0]));
}

TEST_CASE("an effort beyond the limit is clipped before it reaches the bus") {
  Stage stage(8);
  stage.StartRobotAndDriver();
  REQUIRE(stage.Arm());
  Publisher<joint_command_t> publisher(stage.messenger, "JOINT_COMMAND");
  joint_command_t command{};
  command.num_joints = 1;
  command.effort = {1e6};
  command.position = command.velocity = command.kp = command.kd = {NAN};
  float greatest = 0;
  for (int i = 0; i < 10; ++i) {
    command.sequence = i;
    command.utime = stage.Now();
    publisher.Publish(command);
    stage.WaitUntil(
        [&] {
          greatest = std::max(greatest, std::abs(stage.torque));
          return false;
        },
        0.02);
  }
  CHECK(greatest == 2);
}

TEST_CASE("commands that decode and are mad are refused") {
  Stage stage(11);
  stage.StartRobotAndDriver();
  REQUIRE(stage.Arm());
  Publisher<joint_command_t> publisher(stage.messenger, "JOINT_COMMAND");
  joint_command_t command{};
  command.utime = stage.Now();
  command.num_joints = 1;
  command.position = command.velocity = command.kp = command.kd = {NAN};
  for (const double effort : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    ++command.sequence;
    command.effort = {effort};
    publisher.Publish(command);
  }
  stage.Listen(0.2);
  CHECK(stage.drivers.newest().state == driver_status_t::ARMED);
  CHECK(stage.drivers.newest().commands_rejected == 3);
  CHECK(stage.last_torque_time == 0);
}

TEST_CASE("an emergency stop") {
  Stage stage(9);
  stage.RunWithTorque();
  const int64_t asked = stage.Now();
  stage.Request(driver_request_t::ESTOP);
  ExpectSafe(stage, asked, 0);
  ExpectComesBackByArming(stage);
}

TEST_CASE("the driver disarms when it is asked to stop") {
  Stage stage(10);
  stage.RunWithTorque();
  SECTION("by a signal") { stage.children.at("plumb-driver")->Signal(SIGTERM); }
  SECTION("by the run") { stage.coordinator->Stop("plumb-driver"); }
  REQUIRE(stage.WaitUntil([&] { return !stage.coordinator->present("plumb-driver"); }, 600));
  CHECK(stage.children.at("plumb-driver")->WaitFor(60));
  CHECK_FALSE(stage.children.at("plumb-driver")->failed());
  CHECK(stage.WaitUntil([&] { return stage.axis_state == kIdle; }, 1));
  CHECK(stage.torque == 0);
}

TEST_CASE("the driver waits for drives that say by their next heartbeat that they are idle") {
  Stage stage(16);
  const std::filesystem::path file = stage.folder / "robot.toml";
  std::ofstream(file)
      << "extends = \"" << stage.robot_folder << "/robot.toml\"\n[robot]\nurdf = \""
      << stage.robot_folder
      << "/robot.urdf\"\n[driver]\nheartbeat_timeout = 5\n[virtual_robot]\nheartbeat = 1\n";
  stage.robot_folder = file;
  stage.RunWithTorque();
  stage.axis_state = -1;
  REQUIRE(stage.WaitUntil([&] { return stage.axis_state != -1; }, 5));  // a second to the next
  stage.coordinator->Stop("plumb-driver");
  REQUIRE(stage.WaitUntil([&] { return !stage.coordinator->present("plumb-driver"); }, 10));
  CHECK(stage.children.at("plumb-driver")->WaitFor(60));
  CHECK(stage.children.at("plumb-driver")->ending() == "exit status 0");
}

}  // namespace
}  // namespace plumb
