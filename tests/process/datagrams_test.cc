// A flood of malformed datagrams on LCM's group while real processes start, run and are asked to
// stop. In real time: datagrams have no other.

#include <map>

#include "calibrator/motion/log_reader.h"
#include "common/lcm_log_writer.h"
#include "tests/process/flood.h"
#include "tests/process/launch.h"

namespace plumb {
namespace {

using Catch::Contains;

/// Again and again the fragments by which liblcm 1.3.1 writes 4 GB out of bounds, on a channel that
/// everybody listens to at the start, in between others that are cut off or say nothing.
std::vector<std::vector<uint8_t>> Malformed() {
  return {FragmentWith("LCM_SELF_TEST", 1000, 0, 7, 0, 2, 500),
          FragmentWith("", 1000, 0xffffff00, 7, 1, 2, 512),
          FragmentWith("DRIVER_STATUS", 0xffffffff, 0, 8, 0, 2, 500),
          FragmentWith("DRIVER_STATUS", 100, 0, 9, 0, 0, 10),
          {'L', 'C', '0', '2'},
          Whole(std::string(100, 'x'), "")};
}

TEST_CASE("an emergency stop gets through a flood of malformed datagrams") {
  const int rate = GENERATE(70, 10'000);
  INFO(rate << " datagrams a second");
  Stage stage(92, "pendulum", Stage::Time::kReal);
  const Flood flood(stage.lcm_url, Malformed(), rate);
  stage.StartRobotAndDriver();
  for (int i = 0; i < 10; ++i) {
    REQUIRE(stage.Arm(60));
    REQUIRE_FALSE(stage.drivers.newest().stopped_by_request);
    const std::string stop = i % 2 == 0 ? "disarm" : "estop";
    Child request("plumb", {Stage::Binary("plumb"), stop, "--lcm-url", stage.lcm_url},
                  stage.folder / "stop.log");
    CHECK(stage.WaitUntil([&] { return stage.drivers.newest().stopped_by_request; }, 60));
    REQUIRE(stage.WaitUntil([&] { return !request.running(); }, 60));
    INFO(stop << ": " << request.ending() << ": " << request.Tail(5));
    CHECK_FALSE(request.failed());
  }
}

TEST_CASE(
    "no process is ended by a datagram while it starts, whether its LCM URL is given or not") {
  Stage stage(93, "pendulum", Stage::Time::kReal);
  setenv("LCM_DEFAULT_URL", stage.lcm_url.c_str(), 1);
  const std::string url = GENERATE(true, false) ? stage.lcm_url : "";
  INFO("--lcm-url '" << url << "'");
  std::string tested;  // what a process says to itself when it opens LCM, its number first
  const auto tests = stage.messenger.Subscribe(
      "LCM_SELF_TEST", [&](const std::string&, std::span<const uint8_t> message) {
        tested.assign(message.begin(), message.end());
      });
  const std::vector<std::pair<std::string, std::vector<std::string>>> programs{
      {"plumb-driver", {stage.robot_folder, "--bus", stage.bus_url}},
      {"plumb-robot", {stage.robot_folder, "--bus", stage.bus_url}},
      {"plumb-estimator", {stage.robot_folder}},
      {"plumb-controller", {stage.robot_folder}},
      {"plumb-calibrator", {stage.robot_folder, "--checkpoint", stage.folder / "calibration"}},
      {"plumb-trainer", {stage.robot_folder, "--checkpoint", stage.folder / "training"}},
      {"plumb-dashboard",
       {stage.robot_folder, "--address", "127.0.0.1:0", "--page", stage.folder.string()}},
      {"plumb", {"record", stage.folder / "all.lcmlog"}},
      {"plumb", {"meldis", stage.robot_folder}}};
  const Flood flood(stage.lcm_url, Malformed(), 10'000);
  for (auto [name, arguments] : programs) {
    arguments.insert(arguments.begin(), Stage::Binary(name));
    arguments.insert(arguments.end(), {"--lcm-url", url});
    for (int i = 0; i < 5; ++i) {
      Child child(name, arguments, stage.folder / (name + ".log"));
      const bool open = stage.WaitUntil(
          [&] { return !child.running() || tested.starts_with(std::to_string(child.pid()) + " "); },
          60);
      child.Signal(SIGTERM);
      CHECK(child.WaitFor(60));
      INFO(name << ": " << child.Tail(5));
      CHECK(open);
      CHECK(child.ending() == "exit status 0");
    }
  }
  unsetenv("LCM_DEFAULT_URL");
}

TEST_CASE("replay and doctor come to their end under a flood") {
  Stage stage(115, "pendulum", Stage::Time::kReal);
  const std::filesystem::path file = stage.folder / "a.lcmlog";
  LcmLogWriter log(file);
  const std::vector<uint8_t> data(8);
  for (int i = 0; i < 3; ++i) log.Write(100'000 * i, "A", data);
  log.Flush();
  const std::vector<std::pair<std::vector<std::string>, std::string>> commands{
      {{"replay", file}, "3 of 3 messages said"},
      {{"doctor", "--bus", stage.bus_url}, "LCM opens at " + stage.lcm_url}};
  setenv("LCM_DEFAULT_URL", stage.lcm_url.c_str(), 1);
  const std::string url = GENERATE(true, false) ? stage.lcm_url : "";
  INFO("--lcm-url '" << url << "'");
  const Flood flood(stage.lcm_url, Malformed(), 10'000);
  for (auto [arguments, says] : commands) {
    arguments.insert(arguments.begin(), Stage::Binary("plumb"));
    arguments.insert(arguments.end(), {"--lcm-url", url});
    for (int i = 0; i < 5; ++i) {
      Child child("plumb", arguments, stage.folder / "plumb.log");
      CHECK(stage.WaitUntil([&] { return !child.running(); }, 60));
      INFO(child.Tail(20));
      // 1 where the machine is found wanting, or a listener has lost some of the flood.
      CHECK((child.ending() == "exit status 0" || child.ending() == "exit status 1"));
      CHECK_THAT(Read(child.log()), Contains(says));
    }
  }
  unsetenv("LCM_DEFAULT_URL");
}

TEST_CASE("a run and its record go on under a flood") {
  Stage stage(94, "pendulum", Stage::Time::kReal);
  const std::filesystem::path log = stage.folder / "run.lcmlog";
  {
    // No more than the record's socket holds while a busy machine lets it wait for a second or
    // two: there is only one request to arm.
    const Flood flood(stage.lcm_url, Malformed(), 2'000);
    Child launch = Launch(stage, {"--real-time", "--log", log});
    REQUIRE(stage.WaitForDriver(driver_status_t::ARMED, 60));
    INFO(launch.Tail(20));
    CHECK(stage.WaitUntil([&] { return stage.states.received() > 0; }, 60));
    stage.Listen(1);
    REQUIRE(launch.running());
    launch.Signal(SIGINT);
    CHECK(stage.WaitUntil([&] { return !launch.running(); }, 60));
    CHECK(launch.ending() == "exit status 130");
  }
  std::map<std::string, int> messages;
  ReadLog(log, [&](const std::string& channel, const void*, int, int64_t) {
    ++messages[channel];
    return true;
  });
  for (const char* channel : {"JOINT_STATE", "ROBOT_STATE", "DRIVER_STATUS", "DRIVER_REQUEST"}) {
    INFO(channel);
    CHECK(messages[channel] > 0);
  }
}

TEST_CASE("messages that are refused again and again do not fill the log") {
  Stage stage(95);
  Child& controller = stage.Start("plumb-controller");
  REQUIRE(stage.WaitUntil([&] { return stage.controllers.received() > 0; }, 20));
  Publisher<policy_t> policies(stage.messenger, "POLICY");
  policy_t policy{};
  constexpr int kSent = 5000;
  for (int i = 0; i < kSent; ++i) {
    policy.iteration = i;
    policies.Publish(policy);
  }
  stage.Listen(1);
  const std::string log = Read(controller.log());
  const auto refused = [&](int i) {
    return log.find("policy " + std::to_string(i) + " refused") != std::string::npos;
  };
  CHECK(refused(0));
  CHECK(refused(50));
  // A hundred, and one for each second of the machine's time.
  CHECK(std::ranges::count(log, '\n') < kSent / 2);
}

}  // namespace
}  // namespace plumb
