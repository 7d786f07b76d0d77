// The whole loop with the real processes: plumb launch from the prior to an evaluated policy, and the same
// calibration again from its log.

#include <cmath>
#include <nlohmann/json.hpp>

#include "plumb/parameter_distribution_t.hpp"
#include "tests/process/stage.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

// Processes whose command line names the stage's LCM URL.
int Left(const Stage& stage) {
  int left = 0;
  for (const auto& entry : fs::directory_iterator("/proc")) {
    const std::string line = Read(entry.path() / "cmdline");
    if (line.find(stage.lcm_url) != std::string::npos) ++left;
  }
  return left;
}

Child Launch(Stage& stage, std::vector<std::string> flags) {
  std::vector<std::string> arguments{Stage::Binary("plumb"), "launch", stage.robot_folder, "--lcm-url", stage.lcm_url,
                                     "--bus", stage.bus_url, "--output", stage.folder / "run"};
  arguments.insert(arguments.end(), flags.begin(), flags.end());
  return Child("plumb", arguments, stage.folder / "launch.log");
}

TEST_CASE("the loop closes, and its log gives the same distributions bit by bit") {
  Stage stage(30);
  stage.Forgive();
  const fs::path summary_file = stage.folder / "summary.json", log = stage.folder / "run.lcmlog";
  Child launch = Launch(stage, {"--iterations", "2", "--evaluation-episodes", "2", "--speed",
                                Stage::Environment("PLUMBLINE_TEST_SPEED", "2"), "--seed", "3", "--log", log,
                                "--summary", summary_file});
  stage.WaitUntil([&] { return !launch.running(); }, 240);
  INFO(launch.Tail(30));
  REQUIRE_FALSE(launch.running());
  REQUIRE_FALSE(launch.failed());
  CHECK(stage.axis_state == 1);  // disarmed
  CHECK(Left(stage) == 0);

  const auto summary = nlohmann::json::parse(Read(summary_file));
  CHECK(summary.at("seed") == 3);
  REQUIRE(summary.at("iterations").size() == 2);
  CHECK(summary.at("hidden").size() == 3);
  CHECK(summary.at("evaluation_returns").size() == 2);
  for (const auto& iteration : summary.at("iterations")) {
    for (const char* key : {"mean", "sd", "discrepancy", "error", "kl", "simulated_return", "robot_return", "seconds"}) {
      INFO(key);
      CHECK(iteration.contains(key));
      CHECK_FALSE(iteration.at(key).is_null());
    }
    CHECK(iteration.at("kl") > 0);
    CHECK(iteration.at("transitions") >= 150);
  }
  // Two iterations may not reach the truth, but they go towards it: more than halfway from the prior. Which is known better, and
  // comes first, depends on the motion.
  const auto& p = stage.robot.parameters;
  const std::map<std::string, double> prior{
      {"gravity / length", std::exp(p[0].coordinate_mean() - p[2].coordinate_mean())},
      {"mass length^2", std::exp(p[1].coordinate_mean() + 2 * p[2].coordinate_mean())}};
  const auto& combinations = summary.at("iterations")[1].at("combinations");
  REQUIRE(combinations.size() == 2);
  CHECK(combinations[0].at("name") != combinations[1].at("name"));
  for (const auto& combination : combinations) {
    const std::string name = combination.at("name");
    INFO(name);
    REQUIRE(prior.count(name) == 1);
    const double before = prior.at(name), learned = combination.at("mean"), hidden = combination.at("hidden");
    INFO("prior " << before << ", learned " << learned << ", hidden " << hidden);
    CHECK(std::abs(learned - hidden) < 0.5 * std::abs(before - hidden));
  }
  CHECK(summary.at("identifiability").get<std::string>().find("not identifiable separately") != std::string::npos);

  const std::vector<std::string> calibrator{Stage::Binary("plumb-calibrator"), stage.robot_folder, "--seed", "3"};
  const auto same = [&](const fs::path& folder) {
    for (int k = 1; k <= 2; ++k) {
      const std::string name = "distribution_" + std::to_string(k) + ".json";
      INFO(folder / name);
      const std::string live = Read(stage.folder / "run" / "calibration" / name);
      REQUIRE_FALSE(live.empty());
      CHECK(live == Read(folder / name));
    }
  };
  // From the log file, with another number of threads.
  auto arguments = calibrator;
  for (const std::string& flag : {std::string("--log"), log.string(), std::string("--checkpoint"),
                                  (stage.folder / "offline").string(), std::string("--threads"), std::string("1")}) {
    arguments.push_back(flag);
  }
  Child offline("offline", arguments, stage.folder / "offline.log");
  REQUIRE(offline.WaitFor(60));
  INFO(offline.Tail(10));
  REQUIRE_FALSE(offline.failed());
  same(stage.folder / "offline");

  // Played over LCM by lcm-logplayer.
  arguments = calibrator;
  const std::string url = "udpm://239.255.76.67:17750?ttl=0&recv_buf_size=2097152";
  for (const std::string& flag : {std::string("--lcm-url"), url, std::string("--checkpoint"),
                                  (stage.folder / "replayed").string()}) {
    arguments.push_back(flag);
  }
  Messenger listener(url);
  Subscriber<parameter_distribution_t> distributions(listener, "PARAMETER_DISTRIBUTION");
  Child replayed("replayed", arguments, stage.folder / "replayed.log");
  const auto until = [&](const std::function<bool()>& so, double seconds) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    while (!so() && std::chrono::steady_clock::now() < deadline) listener.lcm().handleTimeout(10);
    return so();
  };
  REQUIRE(until([&] { return distributions.received() > 0; }, 10));  // it listens
  // Without the live run's own distributions, which would come in between.
  Child player("lcm-logplayer", {"lcm-logplayer", "--lcm-url=" + url, "--speed=2",
                                 "--regexp=ROBOT_STATE_SMOOTHED|JOINT_COMMAND|CONTROLLER_STATUS", log},
               stage.folder / "player.log");
  CHECK(until([&] { return distributions.newest().iteration == 2; }, 120));
  replayed.Signal(SIGTERM);
  CHECK(replayed.WaitFor(5));
  same(stage.folder / "replayed");
}

TEST_CASE("Ctrl-C stops everything within a second, motors disarmed, nothing left") {
  Stage stage(31);
  Child launch = Launch(stage, {"--speed", "1"});
  REQUIRE(stage.WaitForDriver(driver_status_t::ARMED, 30));
  REQUIRE(stage.WaitUntil([&] { return stage.axis_state == 8; }, 5));
  SECTION("while training") {}
  SECTION("in an episode, with torque on the bus") {
    REQUIRE(stage.WaitUntil([&] { return stage.torque != 0; }, 120));
  }
  SECTION("and again, by an impatient hand") { launch.Signal(SIGINT); }
  launch.Signal(SIGINT);
  const auto start = std::chrono::steady_clock::now();
  CHECK(stage.WaitUntil([&] { return !launch.running(); }, 5));
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  INFO(seconds << " s");
  CHECK(seconds < 1);
  CHECK(stage.axis_state == 1);
  CHECK(stage.torque == 0);
  CHECK(Left(stage) == 0);
}

TEST_CASE("a launcher that is killed takes everything with it") {
  Stage stage(32);
  Child launch = Launch(stage, {"--log", stage.folder / "run.lcmlog"});
  REQUIRE(stage.WaitForDriver(driver_status_t::ARMED, 30));
  launch.Signal(SIGKILL);
  CHECK(stage.WaitUntil([&] { return Left(stage) == 0; }, 5));
}

TEST_CASE("what a person stops, the launcher does not start again") {
  Stage stage(33);
  Child launch = Launch(stage, {});
  REQUIRE(stage.WaitForDriver(driver_status_t::ARMED, 30));
  for (const char* stop : {"disarm", "estop"}) {
    INFO(stop);
    Child request("plumb", {Stage::Binary("plumb"), stop, "--lcm-url", stage.lcm_url}, stage.folder / "stop.log");
    REQUIRE(stage.WaitUntil([&] { return !request.running(); }, 5));
    CHECK_FALSE(request.failed());
    stage.Listen(2);
    CHECK(stage.axis_state == 1);
    CHECK(stage.drivers.newest().state != driver_status_t::ARMED);
    Child arm("plumb", {Stage::Binary("plumb"), "arm", "--lcm-url", stage.lcm_url}, stage.folder / "arm.log");
    REQUIRE(stage.WaitUntil([&] { return !arm.running(); }, 5));
    INFO(arm.Tail(5));
    CHECK_FALSE(arm.failed());
    CHECK(stage.WaitUntil([&] { return stage.axis_state == 8; }, 2));
  }
  launch.Signal(SIGINT);
  CHECK(launch.WaitFor(5));
}

TEST_CASE("a second run beside the first, and a bus that may carry a real robot, are refused") {
  Stage stage(34);
  const auto refusal = [&](const std::string& lcm_url, const std::string& bus_url) {
    Child second("plumb", {Stage::Binary("plumb"), "launch", stage.robot_folder, "--lcm-url", lcm_url, "--bus", bus_url,
                           "--output", stage.folder / "second"},
                 stage.folder / ("second" + std::to_string(stage.frames) + ".log"));
    stage.WaitUntil([&] { return !second.running(); }, 5);
    REQUIRE_FALSE(second.running());
    CHECK(second.failed());
    return second.Tail(5);
  };
  CHECK_THAT(refusal(stage.lcm_url, "socketcan:can0"), Catch::Contains("--real"));
  Child launch = Launch(stage, {});
  REQUIRE(stage.WaitForDriver(driver_status_t::ARMED, 30));
  stage.Listen(0.1);
  CHECK_THAT(refusal(stage.lcm_url, "udp:239.74.163.2:43260"), Catch::Contains("another run is under way"));
  stage.Listen(0.1);
  CHECK_THAT(refusal("udpm://239.255.76.67:17760?ttl=0", stage.bus_url), Catch::Contains("somebody talks on"));
  CHECK(stage.drivers.newest().state == driver_status_t::ARMED);
  launch.Signal(SIGINT);
  CHECK(launch.WaitFor(5));
}

}  // namespace
}  // namespace plumb
