// What must never hurt anybody, with real processes: whatever dies, stops or talks rubbish, the torque goes to zero
// within the configured time, the drive is disarmed, the driver says why, and only a deliberate request re-arms.

#include <arpa/inet.h>
#include <sys/socket.h>

#include <cmath>
#include <cstring>
#include <fstream>

#include "common/random.h"
#include "tests/process/stage.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr int kClosedLoop = 8, kIdle = 1;  // CANSimple axis states
// A frame takes a moment from the driver to the witness, on a machine that is busy with other tests.
constexpr int64_t kSlack = 60'000;  // [us]

int64_t Us(double seconds) { return static_cast<int64_t>(seconds * 1e6); }

// After the event: no torque later than `most` [us] after `since`, drive idle, driver in FAULT with a reason.
void ExpectSafe(Stage& stage, int64_t since, int64_t most) {
  REQUIRE(stage.WaitForDriver(driver_status_t::FAULT, 5));
  CHECK_FALSE(stage.drivers.newest().reason.empty());
  REQUIRE(stage.WaitUntil([&] { return stage.axis_state == kIdle; }, 2));
  INFO(stage.drivers.newest().reason << "; last torque " << stage.last_torque_time - since << " us after the event");
  CHECK(stage.last_torque_time - since <= most + kSlack);
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
  stage.children.at("plumb-estimator")->Signal(SIGKILL);
  stage.WaitUntil([&] { return stage.controllers.newest().phase == controller_status_t::HALTED; }, 3);
  CHECK_THAT(stage.controllers.newest().reason, Catch::Contains("no valid state"));
  ExpectSafe(stage, stage.last_state, Us(stage.robot.controller.state_timeout + stage.robot.driver.cycle));
  stage.Start("plumb-estimator");
  ExpectComesBackByArming(stage);
}

TEST_CASE("a stopped controller") {
  Stage stage(2);
  stage.RunWithTorque();
  stage.children.at("plumb-controller")->Signal(SIGSTOP);
  stage.Listen(0.1);
  ExpectSafe(stage, stage.last_command, Us(stage.robot.driver.expiry + stage.robot.driver.cycle));
  CHECK_THAT(stage.drivers.newest().reason, Catch::Contains("command"));
  // What was on the bus before is on disk, its reason above, the last torques among it.
  std::vector<fs::path> records;
  REQUIRE(stage.WaitUntil([&] {
    records.clear();
    if (fs::exists(stage.folder / "faults")) std::copy(fs::directory_iterator(stage.folder / "faults"), {}, std::back_inserter(records));
    return records.size() == 1 && records[0].extension() == ".log";
  }, 2));
  const std::string record = Read(records[0]);
  CHECK(record.rfind("# no command for", 0) == 0);
  CHECK(record.find(" 02E#00000000 T\n") != std::string::npos);
  CHECK(record.find(" R\n") != std::string::npos);
  // It wakes up with old states in its hands; that alone must not move anything.
  stage.children.at("plumb-controller")->Signal(SIGCONT);
  stage.Listen(0.5);
  CHECK(stage.axis_state == kIdle);
  ExpectComesBackByArming(stage);
}

TEST_CASE("a killed driver: the drive's own watchdog ends it") {
  Stage stage(3);
  stage.RunWithTorque();
  const int64_t killed = Stage::RealUtime();
  stage.children.at("plumb-driver")->Signal(SIGKILL);
  REQUIRE(stage.WaitUntil([&] { return stage.axis_state == kIdle; }, 5));
  CHECK(stage.last_torque_time <= killed + kSlack);
  // A driver that is started beside a running controller does not arm, and takes no old command for a new one.
  stage.Start("plumb-driver", {"--bus", stage.bus_url, "--virtual"});
  stage.Listen(1.5);
  CHECK(stage.axis_state == kIdle);
  CHECK(stage.last_torque_time <= killed + kSlack);
  ExpectComesBackByArming(stage);
}

TEST_CASE("a stopped driver: the watchdog ends it, and it wakes up disarmed") {
  Stage stage(4);
  stage.RunWithTorque();
  stage.children.at("plumb-driver")->Signal(SIGSTOP);
  REQUIRE(stage.WaitUntil([&] { return stage.axis_state == kIdle; }, 5));
  stage.children.at("plumb-driver")->Signal(SIGCONT);
  REQUIRE(stage.WaitForDriver(driver_status_t::FAULT, 5));
  stage.Listen(0.5);
  CHECK(stage.axis_state == kIdle);
  ExpectComesBackByArming(stage);
}

TEST_CASE("a drive that disappears") {
  Stage stage(5);
  stage.RunWithTorque();
  stage.children.at("plumb-robot")->Signal(SIGKILL);
  const int64_t gone = stage.last_state;
  REQUIRE(stage.WaitForDriver(driver_status_t::FAULT, 5));
  stage.Listen(0.5);
  INFO(stage.drivers.newest().reason);
  CHECK(stage.last_torque_time - gone <= Us(stage.robot.driver.stale_after + stage.robot.controller.state_timeout) + kSlack);
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
  const int64_t rejected = stage.drivers.newest().frames_rejected;
  const auto send = [&](const Frame& frame) { stage.bus->Send({&frame, 1}); };
  // Short and not-a-number encoder frames of the very drive, and random frames; not what is well-formed and means
  // something (a real heartbeat of the drive's own id would be a second drive, a real Estop an emergency stop).
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
      for (int k = 0; k < frame.length; ++k) frame.data[static_cast<size_t>(k)] = static_cast<uint8_t>(random.Bits());
      send(frame);
    }
    stage.Listen(0.01);
  }
  stage.Listen(0.5);
  CHECK(stage.drivers.newest().state == driver_status_t::ARMED);
  CHECK(stage.drivers.newest().frames_rejected >= rejected + 100);
  CHECK(stage.children.at("plumb-driver")->running());
  CHECK(stage.children.at("plumb-robot")->running());
  CHECK(std::isfinite(stage.states.newest().q[0]));
}

TEST_CASE("garbage datagrams on the udp bus and on LCM") {
  Stage stage(7);
  if (stage.bus_url.rfind("udp:", 0) != 0) return;  // there is no such thing on SocketCAN
  stage.RunWithTorque();
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const int ttl = 0;
  setsockopt(fd, IPPROTO_IP, IP_MULTICAST_TTL, &ttl, sizeof ttl);
  const auto address = [](const char* group, int port) {
    sockaddr_in a{};
    a.sin_family = AF_INET;
    a.sin_port = htons(static_cast<uint16_t>(port));
    inet_pton(AF_INET, group, &a.sin_addr);
    return a;
  };
  const sockaddr_in targets[] = {address("239.74.163.2", 43207), address("239.255.76.67", 17707)};
  Random random(2);
  std::vector<uint8_t> bytes;
  for (int i = 0; i < 4000; ++i) {
    const sockaddr_in& to = targets[i % 2];
    bytes.resize(4 + random.Bits() % 300);
    for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random.Bits());
    if (i % 4 == 1) std::memcpy(bytes.data(), "LC02", 4);
    if (i % 4 == 3) std::memcpy(bytes.data(), "LC03", 4);
    if (i % 6 == 0) bytes[0] = 0x8b;  // a map of eleven, as a real frame begins
    sendto(fd, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
    if (i % 100 == 0) stage.Listen(0.005);
  }
  // A message with the right fingerprint and a hostile count: plain lcm-cpp subscribers die of it.
  joint_command_t hostile{};
  std::vector<uint8_t> message(static_cast<size_t>(hostile.getEncodedSize()));
  hostile.encode(message.data(), 0, static_cast<int>(message.size()));
  for (const uint32_t count : {0xffffffffu, 0x7fffffffu, 1u << 27}) {
    const uint32_t network = htonl(count);
    std::memcpy(message.data() + 8 + 8 + 8 + 8 + 8 + 4 + 4, &network, 4);
    stage.messenger.lcm().publish("JOINT_COMMAND", message.data(), static_cast<unsigned>(message.size()));
  }
  // Commands that decode and are mad.
  hostile.num_joints = 1;
  hostile.sequence = 1'000'000'000;
  hostile.position = hostile.velocity = hostile.kp = hostile.kd = {NAN};
  Publisher<joint_command_t> publisher(stage.messenger, "JOINT_COMMAND");
  for (const double effort : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    hostile.effort = {effort};
    publisher.Publish(hostile);
  }
  close(fd);
  stage.Listen(0.5);
  CHECK(stage.drivers.newest().state == driver_status_t::ARMED);
  CHECK(stage.drivers.newest().messages_rejected >= 3);
  CHECK(stage.drivers.newest().commands_rejected >= 3);
  CHECK(std::abs(stage.torque) <= 2);
  for (auto& [name, child] : stage.children) {
    INFO(name);
    CHECK(child->running());
  }
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
    command.utime = Stage::RealUtime();
    publisher.Publish(command);
    stage.WaitUntil([&] { greatest = std::max(greatest, std::abs(stage.torque)); return false; }, 0.02);
  }
  CHECK(greatest == 2);
}

TEST_CASE("an emergency stop") {
  Stage stage(9);
  stage.RunWithTorque();
  const int64_t asked = Stage::RealUtime();
  stage.Request(driver_request_t::ESTOP);
  ExpectSafe(stage, asked, Us(2 * stage.robot.driver.cycle));
  ExpectComesBackByArming(stage);
}

TEST_CASE("the driver disarms when it is asked to stop") {
  Stage stage(10);
  stage.RunWithTorque();
  stage.children.at("plumb-driver")->Signal(SIGTERM);
  CHECK(stage.children.at("plumb-driver")->WaitFor(2));
  CHECK_FALSE(stage.children.at("plumb-driver")->failed());
  CHECK(stage.WaitUntil([&] { return stage.axis_state == kIdle; }, 1));
  CHECK(stage.torque == 0);
}

}  // namespace
}  // namespace plumb
