// The same processes over the kernel's own CAN: run by tests/with-vcan, in user-mode-linux where this machine's kernel
// has none.

#include <fmt/format.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>

#include "tests/process/stage.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

size_t Count(const std::string& text, const std::string& pattern) {
  const std::regex regex(pattern);
  return static_cast<size_t>(std::distance(std::sregex_iterator(text.begin(), text.end(), regex), {}));
}

TEST_CASE("the loop closes over SocketCAN, and candump sees it") {
  Stage stage(40);
  REQUIRE(stage.bus_url == "socketcan:vcan0");
  // A foreign witness.
  Child candump("candump", {"candump", "-L", "vcan0"}, stage.folder / "candump.log");
  const fs::path summary_file = stage.folder / "summary.json";
  // The bus is what matters here. In user-mode-linux there is one processor for everything, and on some machines a slow
  // one: half the rate and a policy that has learnt but a little will do, and the robot comes before the trainer.
  constexpr int kRate = 100;  // [Hz]
  const fs::path robot = stage.folder / "robot.toml";
  std::ofstream(robot) << fmt::format(
      "extends = \"{0}/robot.toml\"\n[robot]\nurdf = \"{0}/robot.urdf\"\n"
      "[driver]\ncycle = {1}\nmeasurement = {1}\nstale_after = 0.1\n[training]\nupdates = 3\nupdates_again = 1\n",
      stage.robot_folder, 1. / kRate);
  Child launch("plumb", {Stage::Binary("plumb"), "launch", robot, "--lcm-url", stage.lcm_url, "--bus",
                         stage.bus_url, "--output", stage.folder / "run", "--iterations", "1", "--evaluation-episodes",
                         "1", "--summary", summary_file, "--realtime-priority", "50"},
               stage.folder / "launch.log");
  stage.WaitUntil([&] { return !launch.running(); }, 200);
  INFO(launch.Tail(30));
  REQUIRE_FALSE(launch.running());
  REQUIRE_FALSE(launch.failed());
  CHECK(stage.axis_state == 1);

  const auto summary = nlohmann::json::parse(Read(summary_file));
  REQUIRE(summary.at("iterations").size() == 1);
  CHECK(summary.at("iterations")[0].at("transitions") >= 150);
  CHECK(summary.at("iterations")[0].at("discrepancy") < summary.at("iterations")[0].at("prior_discrepancy"));
  CHECK(summary.at("evaluation_returns").size() == 1);

  candump.Signal(SIGINT);
  candump.WaitFor(2);
  const std::string frames = Read(candump.log());
  CHECK(Count(frames, "vcan0 027#0800000000000000") >= 1);       // closed-loop control is asked for
  CHECK(Count(frames, "vcan0 02E#[0-9A-F]{8}") > 20 * kRate);   // torques, for more than two roll-outs
  CHECK(Count(frames, "vcan0 029#[0-9A-F]{16}") > 20 * kRate);   // encoder estimates
  CHECK(Count(frames, "vcan0 021#[0-9A-F]{8}08") > 100);         // heartbeats of an armed drive
}

TEST_CASE("a bus that is taken down: fault with a reason, and back only by arming") {
  Stage stage(41);
  stage.RunWithTorque();
  REQUIRE(std::system("ip link set vcan0 down") == 0);
  REQUIRE(stage.WaitForDriver(driver_status_t::FAULT, 5));
  INFO(stage.drivers.newest().reason);
  CHECK_THAT(stage.drivers.newest().reason, Catch::Contains("interface is down"));
  CHECK_FALSE(stage.drivers.newest().bus_up);
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

}  // namespace
}  // namespace plumb
