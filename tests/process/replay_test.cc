// plumb replay and plumb record as processes: what is said again is what was recorded, to everybody
// who listens, and moves no robot.

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>

#include <Eigen/Geometry>
#include <cmath>

#include "common/file_descriptor.h"
#include "common/lcm_log_reader.h"
#include "common/lcm_log_writer.h"
#include "common/lcm_url.h"
#include "records/drake_viewer.h"
#include "robot/kinematics.h"
#include "tests/process/launch.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Catch::Contains;

constexpr double kLong = 600;  // [s] of real time: whoever is as late as that hangs

/// A program of somebody else's: its buffer has the kernel's default size, and it takes its time.
class SlowListener {
 public:
  explicit SlowListener(const std::string& url)
      : fd_(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)) {
    const MulticastAddress address = ParseUdpm(url);
    const int yes = 1;
    setsockopt(fd_.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    sockaddr_in here{};
    here.sin_family = AF_INET;
    here.sin_port = htons(address.port);
    REQUIRE(bind(fd_.get(), reinterpret_cast<const sockaddr*>(&here), sizeof here) == 0);
    ip_mreqn group{};
    inet_pton(AF_INET, address.group.c_str(), &group.imr_multiaddr);
    REQUIRE(setsockopt(fd_.get(), IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group) == 0);
  }
  /// A few messages. @return whether there were any.
  bool Take() {
    std::vector<char> datagram(65536);
    int taken = 0;
    for (; taken < 50; ++taken) {
      const ssize_t size = recv(fd_.get(), datagram.data(), datagram.size(), 0);
      if (size <= 8) break;
      heard.emplace_back(datagram.data() + 8, static_cast<size_t>(size - 8));  // LC02, number
    }
    usleep(1000);
    return taken > 0;
  }
  std::vector<std::string> heard;  // channel, a zero byte, data

 private:
  FileDescriptor fd_;
};

std::string Text(const std::string& channel, int i) {
  return channel + '\0' + std::to_string(i) + std::string(static_cast<size_t>(i % 300), '.');
}

/// A log of that many messages, 0.1 ms one after the other.
void WriteLog(const fs::path& file, int messages) {
  LcmLogWriter log(file);
  for (int i = 0; i < messages; ++i) {
    const std::string data = Text("", i).substr(1);
    log.Write(1'700'000'000'000'000 + 100 * i, "A" + std::to_string(i % 3),
              {reinterpret_cast<const uint8_t*>(data.data()), data.size()});
  }
  log.Flush();
}

Child Plumb(const Stage& stage, const std::string& command, std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(),
                   {Stage::Binary("plumb"), command, "--lcm-url", stage.lcm_url});
  return Child("plumb", arguments, stage.folder / (command + ".log"));
}

TEST_CASE("a replay as fast as possible loses nothing, however slow a listener is") {
  Stage stage(110, "pendulum", Stage::Time::kReal);
  constexpr int kMessages = 20'000;
  WriteLog(stage.folder / "a.lcmlog", kMessages);
  SlowListener listener(stage.lcm_url);
  Child replay = Plumb(stage, "replay", {stage.folder / "a.lcmlog", "--speed", "0"});
  while (replay.running()) listener.Take();
  while (listener.Take()) continue;
  INFO(replay.Tail(5));
  CHECK_FALSE(replay.failed());
  CHECK_THAT(replay.Tail(5), Contains("20000 of 20000 messages said"));
  std::erase_if(listener.heard, [](const std::string& m) { return m.starts_with("LCM_SELF"); });
  REQUIRE(listener.heard.size() == kMessages);
  for (int i = 0; i < kMessages; ++i)
    REQUIRE(listener.heard[static_cast<size_t>(i)] == Text("A" + std::to_string(i % 3), i));
}

TEST_CASE("what is recorded of a replay is what was replayed, seals and all, in its part") {
  Stage stage(111, "pendulum", Stage::Time::kReal);
  WriteLog(stage.folder / "a.lcmlog", 3000);
  Child record =
      Plumb(stage, "record",
            {stage.folder / "b.lcmlog", "--robot", stage.robot_folder, "--note", "a \"test\""});
  REQUIRE(AwaitReally([&] { return record.Tail(5).find("recording to") != std::string::npos; }));
  // 0.1 to 0.2 s of it, twice as fast.
  Child replay = Plumb(stage, "replay",
                       {stage.folder / "a.lcmlog", "--from", "0.1", "--to", "0.2", "--speed", "2"});
  REQUIRE(replay.WaitFor(kLong));
  INFO(replay.Tail(5));
  CHECK_FALSE(replay.failed());
  record.Signal(SIGINT);
  REQUIRE(record.WaitFor(kLong));
  LcmLogReader log(stage.folder / "b.lcmlog");
  LcmLogEvent event;
  int i = 1000;
  while (log.Read(event)) {
    if (event.channel.starts_with("LCM_SELF")) continue;
    REQUIRE(event.channel + '\0' + std::string(event.data.begin(), event.data.end()) ==
            Text("A" + std::to_string(i % 3), i));
    ++i;
  }
  CHECK(i == 2001);
  CHECK(LoadRobot(stage.folder / "b.lcmlog.d").name == "pendulum");
  CHECK_THAT(Read(stage.folder / "b.lcmlog.d/record.json"), Contains(R"("note": "a \"test\"")"));
}

TEST_CASE("a replay that is interrupted, cannot be read, or has no place, says so in a line") {
  Stage stage(112, "pendulum", Stage::Time::kReal);
  const fs::path file = stage.folder / "a.lcmlog";
  WriteLog(file, 3);
  Child forever = Plumb(stage, "replay", {file, "--loop"});
  SlowListener listener(stage.lcm_url);
  REQUIRE(AwaitReally([&] {
    listener.Take();
    return std::ranges::any_of(listener.heard, [](const auto& m) { return m.starts_with("A"); });
  }));
  Child second = Plumb(stage, "replay", {file});
  REQUIRE(second.WaitFor(kLong));
  CHECK_THAT(second.Tail(5), Contains("a run or a replay is under way on " + stage.lcm_url));
  forever.Signal(SIGINT);
  REQUIRE(forever.WaitFor(kLong));
  CHECK(forever.ending() == "exit status 130");
  std::ofstream(file, std::ios::app) << "rubbish of more than twenty-eight bytes, behind it";
  Child damaged = Plumb(stage, "replay", {file});
  REQUIRE(damaged.WaitFor(kLong));
  CHECK(damaged.ending() == "exit status 1");
  CHECK_THAT(damaged.Tail(5), Contains(file.string() + ": damaged at byte 9"));
}

TEST_CASE("where a driver speaks nothing is replayed, and a driver that starts ends a replay") {
  Stage stage(113, "pendulum", Stage::Time::kReal);
  const fs::path file = stage.folder / "a.lcmlog";
  WriteLog(file, 3);
  SECTION("before it begins") {
    stage.StartRobotAndDriver();
    REQUIRE(stage.WaitUntil([&] { return stage.drivers.received() > 0; }, kLong));
    SlowListener listener(stage.lcm_url);
    Child replay = Plumb(stage, "replay", {file});
    REQUIRE(stage.WaitUntil([&] { return !replay.running(); }, kLong));
    CHECK(replay.ending() == "exit status 1");
    CHECK_THAT(replay.Tail(5), Contains("a driver speaks on " + stage.lcm_url));
    while (listener.Take()) continue;
    for (const std::string& message : listener.heard) CHECK_FALSE(message.starts_with("A"));
  }
  SECTION("while it plays") {
    Child replay = Plumb(stage, "replay", {file, "--loop"});
    stage.StartRobotAndDriver();
    REQUIRE(stage.WaitUntil([&] { return !replay.running(); }, kLong));
    CHECK(replay.ending() == "exit status 1");
    CHECK_THAT(replay.Tail(5), Contains("a driver speaks on " + stage.lcm_url));
  }
}

TEST_CASE("Drake's viewer is told of the robot that is heard, and of no other") {
  Stage stage(114, "pendulum", Stage::Time::kReal);
  const Subscriber<drake::lcmt_viewer_load_robot> loads(stage.messenger, "DRAKE_VIEWER_LOAD_ROBOT");
  const Subscriber<drake::lcmt_viewer_draw> draws(stage.messenger, "DRAKE_VIEWER_DRAW");
  Child meldis = Plumb(stage, "meldis", {stage.robot_folder});
  Publisher<robot_state_t> states(stage.messenger, "ROBOT_STATE");
  robot_state_t state{}, foreign{};
  state.num_positions = state.num_velocities = 1;
  state.q = state.v = state.q_sd = state.v_sd = state.effort = {0.5};
  foreign.num_positions = foreign.num_velocities = 2;
  foreign.q = foreign.v = foreign.q_sd = foreign.v_sd = foreign.effort = {1, NAN};
  REQUIRE(stage.WaitUntil(
      [&] {
        state.utime += 1000;
        states.Publish(state);
        states.Publish(foreign);
        return loads.received() > 1 && draws.received() > 2;
      },
      kLong));
  CHECK(loads.newest().num_links == static_cast<int>(stage.robot.links.size()));
  const std::vector<Pose> poses = LinkPoses(stage.robot, Eigen::VectorXd::Constant(1, 0.5));
  const auto& turn = draws.newest().quaternion.at(1);
  CHECK(Eigen::Quaternionf(turn[0], turn[1], turn[2], turn[3])
            .toRotationMatrix()
            .isApprox(poses[1].rotation.cast<float>(), 1e-5f));
  meldis.Signal(SIGINT);
  REQUIRE(meldis.WaitFor(kLong));
  CHECK_FALSE(meldis.failed());
  CHECK_THAT(meldis.Tail(10), Contains("a ROBOT_STATE of 2 numbers is not one of pendulum"));
}

}  // namespace
}  // namespace plumb
