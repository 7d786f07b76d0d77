// Mistakes of setting up: one clear line each, a non-zero exit status, nothing armed.

#include <fstream>

#include "tests/process/stage.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Catch::Contains;

// Runs a program to its end. @return its output; checks that it failed.
std::string FailureOf(const fs::path& folder, std::vector<std::string> arguments) {
  const fs::path log = folder / "output.log";
  fs::remove(log);
  Child child("program", arguments, log);
  REQUIRE(child.WaitFor(120));
  CHECK(child.failed());
  return child.Tail(50);
}

size_t Lines(const std::string& text) {
  return static_cast<size_t>(std::count(text.begin(), text.end(), '\n'));
}

TEST_CASE("a typo in robot.toml stops every process with the same line") {
  Stage stage(20);
  const fs::path robot = stage.folder / "pendulum";
  fs::copy(stage.robot_folder, robot);
  std::ifstream in(stage.robot_folder + "/robot.toml");
  std::string text{std::istreambuf_iterator<char>(in), {}};
  text.replace(text.find("expiry ="), 8, "expirey =");
  std::ofstream(robot / "robot.toml") << text;
  for (const char* name : {"plumb-driver", "plumb-estimator", "plumb-controller",
                           "plumb-calibrator", "plumb-trainer", "plumb-robot"}) {
    INFO(name);
    const std::string output =
        FailureOf(stage.folder, {Stage::Binary(name), robot, "--lcm-url", stage.lcm_url});
    CHECK(Lines(output) == 1);
    CHECK_THAT(
        output,
        Contains("robot.toml:13:11: driver.expirey is not a known key; did you mean expiry?"));
  }
  const std::string output = FailureOf(
      stage.folder, {Stage::Binary("plumb"), "launch", robot, "--lcm-url", stage.lcm_url});
  CHECK(Lines(output) == 1);
  CHECK_THAT(output, Contains("did you mean expiry?"));
}

TEST_CASE("a CAN interface that is not there") {
  Stage stage(21);
  for (const std::vector<std::string>& program :
       {std::vector<std::string>{Stage::Binary("plumb-driver"), stage.robot_folder},
        std::vector<std::string>{Stage::Binary("plumb"), "launch", stage.robot_folder}}) {
    std::vector<std::string> arguments = program;
    arguments.insert(arguments.end(), {"--bus", "socketcan:vcan7", "--lcm-url", stage.lcm_url});
    const std::string output = FailureOf(stage.folder, arguments);
    CHECK(Lines(output) == 1);
    CHECK_THAT(output, Contains("vcan7") || Contains("udp:") || Contains("--real"));
  }
  const std::string output =
      FailureOf(stage.folder, {Stage::Binary("plumb-driver"), stage.robot_folder, "--bus",
                               "canbus:0", "--lcm-url", stage.lcm_url});
  CHECK(Lines(output) == 1);
  CHECK_THAT(output, Contains("canbus:0"));
}

// In a network namespace whose only interface has no address there is no route for anything.
TEST_CASE("a machine without a multicast route") {
  Stage stage(22);
  const fs::path probe = stage.folder / "probe.log";
  Child unshare("unshare", {"unshare", "-n", "true"}, probe);
  REQUIRE(unshare.WaitFor(60));
  if (unshare.failed()) {
    WARN("no privilege for a network namespace here: not tested");
    return;
  }
  for (const char* name : {"plumb-estimator", "plumb-controller", "plumb-driver"}) {
    INFO(name);
    const std::string output = FailureOf(
        stage.folder,
        {"unshare", "-n", Stage::Binary(name), stage.robot_folder, "--lcm-url", stage.lcm_url});
    CHECK_THAT(output, Contains("multicast"));
    CHECK_THAT(output,
               Contains("ip route add 224.0.0.0/4 dev lo") || Contains("ip link set lo up"));
  }
  const std::string doctor =
      FailureOf(stage.folder, {"unshare", "-n", Stage::Binary("plumb"), "doctor"});
  CHECK_THAT(doctor, Contains("BAD"));
  CHECK_THAT(doctor, Contains("cure: ip link set lo up multicast on"));
}

TEST_CASE("wrong flags are usage errors") {
  Stage stage(23);
  for (const std::vector<std::string>& flags :
       std::vector<std::vector<std::string>>{{"plumb", "launch", "--iterations", "0"},
                                             {"plumb", "lunch"},
                                             {"plumb-driver"},
                                             {"plumb-trainer", "x", "--y"}}) {
    std::vector<std::string> arguments = flags;
    arguments[0] = Stage::Binary(arguments[0]);
    Child child("program", arguments, stage.folder / "output.log");
    REQUIRE(child.WaitFor(120));
    CHECK(child.ending() == "exit status 2");
  }
  for (const auto& [in_vain, words] : std::vector<std::pair<std::vector<std::string>, std::string>>{
           {{"--can-log", stage.folder / "can.log", "--real-time"}, "--real-time excludes"},
           {{"--can-log", stage.folder / "can.log", "--real"}, "--real excludes"},
           {{"--policy", ""}, "--policy: is empty"},  // as of a variable that is not set
           {{"--overwrite"}, "--overwrite needs --log or --can-log"},
           {{"--realtime-priority", "50"}, "needs --real-time or --real"}}) {
    std::vector<std::string> arguments{Stage::Binary("plumb"), "launch", stage.robot_folder,
                                       "--output", stage.folder / "run"};
    arguments.insert(arguments.end(), in_vain.begin(), in_vain.end());
    CHECK_THAT(FailureOf(stage.folder, arguments), Contains(words));
    CHECK_FALSE(fs::exists(stage.folder / "run"));
  }
  const std::string output =
      FailureOf(stage.folder, {Stage::Binary("plumb"), "launch", stage.robot_folder, "--lcm-url",
                               stage.lcm_url, "--clock", "fast"});
  CHECK_THAT(output, Contains("'fast' is not SCALE"));
}

TEST_CASE("a clock that nobody keeps") {
  Stage stage(25);
  for (const char* name : {"plumb-driver", "plumb-estimator", "plumb-controller", "plumb-robot"}) {
    INFO(name);
    const std::string output =
        FailureOf(stage.folder, {Stage::Binary(name), stage.robot_folder, "--clock",
                                 "virtual:" + (stage.folder / "none").string()});
    CHECK(Lines(output) == 1);
    CHECK_THAT(output, Contains("none: nobody keeps a run's time there"));
  }
}

TEST_CASE("arming where there is no driver says so") {
  Stage stage(24);
  CHECK_THAT(FailureOf(stage.folder, {Stage::Binary("plumb"), "arm", "--lcm-url", stage.lcm_url}),
             Contains("no driver answers"));
}

}  // namespace
}  // namespace plumb
