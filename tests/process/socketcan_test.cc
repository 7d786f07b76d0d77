// The same processes over the kernel's own CAN: run by tests/with-vcan, in user-mode-linux where
// this machine's kernel has none.

#include <algorithm>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <regex>

#include "tests/process/launch.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr int kRate = 200;  // [Hz] of torques and estimates

size_t Count(const std::string& text, const std::string& pattern) {
  const std::regex regex(pattern);
  return static_cast<size_t>(
      std::distance(std::sregex_iterator(text.begin(), text.end(), regex), {}));
}

TEST_CASE("the loop closes over SocketCAN, and candump sees it") {
  Stage stage(40, "pendulum", Stage::Time::kReal);
  REQUIRE(stage.bus_url == "socketcan:vcan0");
  // A foreign witness.
  Child candump("candump", {"stdbuf", "-oL", "candump", "-L", "-r", "8000000", "vcan0"},
                stage.folder / "candump.log");
  const fs::path summary_file = stage.folder / "summary.json", can_log = stage.folder / "can.log";
  LearnLittle(stage);
  Child launch = Launch(stage, {"--iterations", "1", "--evaluation-episodes", "1", "--summary",
                                summary_file, "--can-log", can_log});
  stage.WaitUntil([&] { return !launch.running(); }, 1200);
  INFO(launch.Tail(30));
  REQUIRE_FALSE(launch.running());
  REQUIRE_FALSE(launch.failed());
  CHECK_THAT(LastFrame(can_log, "021"), Catch::StartsWith("0000000001"));

  const auto summary = nlohmann::json::parse(Read(summary_file));
  REQUIRE(summary.at("iterations").size() == 1);
  CHECK(summary.at("iterations")[0].at("transitions") >= 150);
  CHECK(summary.at("iterations")[0].at("discrepancy") <
        summary.at("iterations")[0].at("prior_discrepancy"));
  CHECK(summary.at("evaluation_returns").size() == 1);

  const auto lines = [](const fs::path& log) { return std::ranges::count(Read(log), '\n'); };
  CHECK(AwaitReally([&] { return lines(candump.log()) >= lines(can_log); }));
  // It has seen the frames that the run has recorded, but for the times, which are the kernel's.
  const std::regex time(R"(\([0-9.]+\) )");
  const std::string seen = std::regex_replace(Read(candump.log()), time, ""),
                    said = std::regex_replace(Read(can_log), time, "");
  CHECK(seen == said);
  // And it is the same run as without any such bus.
  Child again("plumb",
              {Stage::Binary("plumb"), "launch", stage.robot_folder, "--lcm-url", "memq://",
               "--bus", "loop:", "--output", stage.folder / "again", "--iterations", "1",
               "--evaluation-episodes", "1", "--can-log", stage.folder / "again.log"},
              stage.folder / "again.output");
  stage.WaitUntil([&] { return !again.running(); }, 1200);
  INFO(again.Tail(30));
  REQUIRE_FALSE(again.running());
  CHECK(std::regex_replace(said, std::regex("vcan0 "), "can0 ") ==
        std::regex_replace(Read(stage.folder / "again.log"), time, ""));
  CHECK(Count(said, "vcan0 027#0800000000000000") >= 1);  // closed-loop control is asked for
  // torques, for more than two roll-outs
  CHECK(Count(said, "vcan0 02E#[0-9A-F]{8}") > 2 * 10 * kRate);
  CHECK(Count(said, "vcan0 029#[0-9A-F]{16}") > 2 * 10 * kRate);  // encoder estimates
  CHECK(Count(said, "vcan0 021#[0-9A-F]{8}08") > 100);            // heartbeats of an armed drive
}

TEST_CASE("a bus that is taken down: fault with a reason, and back only by arming") {
  Stage stage(41);
  stage.RunWithTorque();
  REQUIRE(std::system("ip link set vcan0 down") == 0);
  REQUIRE(stage.WaitForDriver(driver_status_t::FAULT, 5));
  INFO(stage.drivers.newest().reason);
  CHECK_THAT(stage.drivers.newest().reason, Catch::Contains("interface is down"));
  CHECK_FALSE(stage.drivers.newest().buses[0].up);
  REQUIRE(std::system("ip link set vcan0 up") == 0);
  // The drive's watchdog has disarmed it meanwhile; nothing that was queued comes out now.
  stage.torque = 0;
  stage.bus->Reopen();
  REQUIRE(stage.WaitUntil([&] { return stage.axis_state == 1; }, 5));
  stage.Listen(1);
  CHECK(stage.torque == 0);
  CHECK(stage.axis_state == 1);
  CHECK(stage.drivers.newest().state == driver_status_t::FAULT);
  CHECK(stage.BeginEpisode());
}

TEST_CASE("one of two interfaces is taken down: the drives on the other stop, too") {
  const auto ip = [](const std::string& what) {
    return std::system(("ip link " + what).c_str()) == 0;
  };
  REQUIRE(ip("add dev vcanboom type vcan"));
  REQUIRE(ip("set vcanboom up"));
  {
    Stage stage(43, "hopper/two_buses.toml");
    const std::vector<std::string> buses{"--bus", "leg=" + stage.bus_url, "--bus",
                                         "boom=socketcan:vcanboom"};
    std::vector<std::string> driver = buses;
    driver.push_back("--virtual");
    stage.Start("plumb-robot", buses);
    stage.Start("plumb-driver", driver);
    stage.Start("plumb-estimator");
    stage.Start("plumb-controller");
    REQUIRE(stage.Arm(20));
    REQUIRE(stage.WaitUntil([&] { return stage.axis_state == 8; }, 1));
    REQUIRE(ip("set vcanboom down"));
    REQUIRE(stage.WaitForDriver(driver_status_t::FAULT, 5));
    CHECK(stage.drivers.newest().reason == "bus boom: the CAN interface is down");
    CHECK(stage.WaitUntil([&] { return stage.axis_state == 1; }, 1));
    CHECK(stage.drivers.newest().buses[0].up);
    CHECK_FALSE(stage.drivers.newest().buses[1].up);
    REQUIRE(ip("set vcanboom up"));
    CHECK(stage.WaitUntil([&] { return stage.drivers.newest().buses[1].up; }, 5));
    stage.Listen(1);
    CHECK(stage.drivers.newest().state == driver_status_t::FAULT);
    CHECK(stage.Arm(20));
  }
  CHECK(ip("del vcanboom"));
}

}  // namespace
}  // namespace plumb
