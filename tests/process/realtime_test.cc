// Tests of the wall clock: the loop as a real robot has it, and witnesses who play and disturb
// at their own pace.

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "common/message_bytes.h"
#include "common/process_number.h"
#include "common/random.h"
#include "plumb/parameter_distribution_t.hpp"
#include "tests/process/launch.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

TEST_CASE("the loop closes in real time") {
  Stage stage(50, "pendulum", Stage::Time::kReal);
  LearnLittle(stage);
  const fs::path summary_file = stage.folder / "summary.json", log = stage.folder / "run.lcmlog";
  Child launch =
      Launch(stage, {"--real-time", "--speed", "2", "--iterations", "1", "--evaluation-episodes",
                     "1", "--seed", "3", "--log", log, "--summary", summary_file});
  stage.WaitUntil([&] { return !launch.running(); }, 120);
  INFO(launch.Tail(30));
  REQUIRE_FALSE(launch.running());
  REQUIRE_FALSE(launch.failed());
  CHECK(stage.axis_state == 1);  // disarmed
  CHECK(Left(stage) == 0);
  const auto summary = nlohmann::json::parse(Read(summary_file));
  REQUIRE(summary.at("iterations").size() == 1);
  CHECK(summary.at("iterations")[0].at("transitions") >= 150);

  // The same calibration from its log, played by lcm-logplayer, without the run's own
  // distributions, which would come in between.
  const std::string url = "udpm://239.255.76.67:17751?ttl=0&recv_buf_size=2097152";
  Messenger listener(url);
  Subscriber<parameter_distribution_t> distributions(listener, "PARAMETER_DISTRIBUTION");
  Child replayed("replayed",
                 {Stage::Binary("plumb-calibrator"), stage.robot_folder, "--seed", "3", "--lcm-url",
                  url, "--checkpoint", stage.folder / "replayed"},
                 stage.folder / "replayed.log");
  const auto until = [&](const std::function<bool()>& so, double seconds) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    while (!so() && std::chrono::steady_clock::now() < deadline)
      listener.Await(10), listener.Drain();
    return so();
  };
  REQUIRE(until([&] { return distributions.received() > 0; }, 60));  // it listens
  Child player("lcm-logplayer",
               {"lcm-logplayer", "--lcm-url=" + url, "--speed=4",
                "--regexp=ROBOT_STATE_SMOOTHED|JOINT_COMMAND|CONTROLLER_STATUS", log},
               stage.folder / "player.log");
  CHECK(until([&] { return distributions.newest().iteration == 1; }, 120));
  replayed.Signal(SIGTERM);
  CHECK(replayed.WaitFor(60));
  const std::string live = Read(stage.folder / "run" / "calibration" / "posterior_1.json");
  REQUIRE_FALSE(live.empty());
  CHECK(live == Read(stage.folder / "replayed" / "posterior_1.json"));
}

TEST_CASE("Ctrl-C stops everything within a second") {
  Stage stage(51, "pendulum", Stage::Time::kReal);
  std::vector<std::string> flags;
  SECTION("in virtual time") {}
  SECTION("in real time") { flags = {"--real-time"}; }
  Child launch = Launch(stage, flags);
  REQUIRE(stage.WaitForDriver(driver_status_t::ARMED, 60));
  launch.Signal(SIGINT);
  const auto start = std::chrono::steady_clock::now();
  CHECK(stage.WaitUntil([&] { return !launch.running(); }, 60));
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  INFO(seconds << " s");
  CHECK(seconds < 1);
  CHECK(stage.axis_state == 1);
  CHECK(stage.torque == 0);
  CHECK(Left(stage) == 0);
}

TEST_CASE(
    "a launch that is stopped changes nothing; one that is killed takes all with it, and the drive "
    "ends up idle") {
  Stage stage(52, "pendulum", Stage::Time::kReal);
  Child launch = Launch(stage, {"--real-time"});
  // It has the robot move as soon as the first policy is trained; a policy of ours need not be. It
  // is one of the run's, before the trainer has said its own.
  stage.messenger.Become(
      Identity("stage", {}, stage.clock, Identity::Reach::kMachine, ProcessNumber(launch.pid())));
  REQUIRE(stage.WaitUntil([&] { return stage.controllers.received() > 0; }, 60));
  REQUIRE(stage.BeginEpisode());
  launch.Signal(SIGSTOP);
  stage.longest_alone = 0;
  stage.Listen(1);
  const auto expiry = std::llround((stage.robot.driver.expiry + stage.robot.driver.cycle) * 1e6);
  CHECK(stage.longest_alone > 0);
  CHECK(stage.longest_alone <= expiry + 20'000);
  CHECK(stage.torque != 0);
  launch.Signal(SIGKILL);
  CHECK(stage.WaitUntil([&] { return Left(stage) == 0; }, 60));
  CHECK(stage.torque == 0);
}

TEST_CASE("garbage datagrams on the udp bus and on LCM") {
  Stage stage(53, "pendulum", Stage::Time::kReal);
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
  const sockaddr_in targets[] = {address("239.74.163.2", 23253), address("239.255.76.67", 17753)};
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
  std::vector<uint8_t> message = Encode(hostile);
  for (const uint32_t count : {0xffffffffu, 0x7fffffffu, 1u << 27}) {
    const uint32_t network = htonl(count);
    std::memcpy(message.data() + 8 + 8 + 8 + 8 + 8 + 4 + 4, &network, 4);
    stage.messenger.Publish("JOINT_COMMAND", message);
  }
  stage.Listen(0.5);
  CHECK(stage.drivers.newest().state == driver_status_t::ARMED);
  CHECK(stage.drivers.newest().messages_rejected >= 3);
  for (auto& [name, child] : stage.children) {
    INFO(name);
    CHECK(child->running());
  }
  // One that decodes is a second speaker's: the driver disarms, says who it is, and ends.
  hostile.num_joints = 1;
  hostile.effort = {2};
  hostile.position = hostile.velocity = hostile.kp = hostile.kd = {NAN};
  Publisher<joint_command_t>(stage.messenger, "JOINT_COMMAND").Publish(hostile);
  close(fd);
  Child& driver = *stage.children.at("plumb-driver");
  REQUIRE(stage.WaitUntil([&] { return !driver.running(); }, 60));
  CHECK(driver.failed());
  CHECK_THAT(driver.Tail(5),
             Catch::Contains("two speak on JOINT_COMMAND: process ") &&
                 Catch::Contains("(plumb-controller) and somebody who does not say who"));
  CHECK(stage.drivers.newest().commands_rejected == 0);
  CHECK(stage.WaitUntil([&] { return stage.axis_state == 1; }, 5));
  CHECK(stage.torque == 0);
}

}  // namespace
}  // namespace plumb
