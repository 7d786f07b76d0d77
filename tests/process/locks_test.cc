// Two runs that begin at the same moment.

#include <chrono>
#include <thread>
#include <vector>

#include "tests/process/launch.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Catch::Contains;

// One of the two, whichever it is, is refused at once; the other goes on until it is stopped.
void OneIsRefused(std::vector<Child>& runs, const std::string& words) {
  while (runs[0].running() && runs[1].running())
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  Child &refused = runs[runs[0].running() ? 1 : 0], &other = runs[runs[0].running() ? 0 : 1];
  INFO(refused.Tail(20));
  CHECK(refused.ending() == "exit status 1");
  CHECK_THAT(refused.Tail(3), Contains(words));
  CHECK(other.running());
  other.Signal(SIGINT);
  REQUIRE(other.WaitFor(120));
}

TEST_CASE(
    "two calibrations with one journal, two trainings with one checkpoint, two experiments with "
    "one table, two records in one log") {
  Stage stage(64);
  const std::string pendulum = stage.robot_folder;
  std::string program = "plumb", words = "another process is at work on it";
  std::vector<std::string> arguments;
  SECTION("calibrate") {
    const std::string table = stage.folder / "table.csv";
    Child sim("plumb",
              {Stage::Binary("plumb"), "sim", pendulum, "--random", "--episodes", "20", "--seed",
               "3", "--csv", table},
              stage.folder / "sim.log");
    REQUIRE(sim.WaitFor(120));
    REQUIRE_FALSE(sim.failed());
    arguments = {"calibrate", pendulum,   "--csv",     table,      "--method",
                 "reps",      "--budget", "100000000", "--output", stage.folder / "posterior.json"};
    words = "posterior.json.journal: " + words;
  }
  SECTION("train") {
    arguments = {"train", pendulum, "--steps", "1e9", "--output", stage.folder / "policy.onnx"};
    words = "policy.onnx.checkpoint: " + words;
  }
  SECTION("a calibrator by hand") {
    program = "plumb-calibrator", words = "another calibrator is at work there";
    arguments = {pendulum, "--lcm-url", "memq://", "--checkpoint", stage.folder / "checkpoints"};
  }
  SECTION("a trainer by hand") {
    program = "plumb-trainer", words = "another trainer is at work there";
    arguments = {pendulum, "--lcm-url", "memq://", "--checkpoint", stage.folder};
  }
  SECTION("a driver") {
    program = "plumb-driver", words = "another driver is at work on " + stage.bus_url;
    arguments = {pendulum, "--lcm-url", "memq://", "--bus", stage.bus_url};
  }
  SECTION("a virtual robot") {
    program = "plumb-robot",
    words = "another virtual robot has the drive of node 1 on " + stage.bus_url;
    arguments = {pendulum, "--lcm-url", "memq://", "--bus", stage.bus_url};
  }
  SECTION("an estimator or a controller") {
    program = GENERATE("plumb-estimator", "plumb-controller");
    words = "another " + program + " of pendulum is at work on " + stage.lcm_url;
    arguments = {pendulum, "--lcm-url", stage.lcm_url};
  }
  SECTION("a record") {
    arguments = {"--lcm-url", "memq://", "record", stage.folder / "run.lcmlog"};
    words = "run.lcmlog: is being written already";
  }
  SECTION("an experiment") {
    program = "plumb-reality-gap";
    arguments = {fs::path(pendulum).parent_path(), "--gaps", "pendulum", "--output",
                 stage.folder / "gap"};
    words = "reality_gap.csv: " + words;
  }
  arguments.insert(arguments.begin(), Stage::Binary(program));
  std::vector<Child> runs;
  for (const char* log : {"a.log", "b.log"})
    runs.emplace_back(program, arguments, stage.folder / log);
  OneIsRefused(runs, words);
}

TEST_CASE("two launches on one bus, one LCM group or in one folder at the same moment") {
  Stage stage(62);
  const auto launch = [&](const std::string& lcm_url, const std::string& bus,
                          const std::string& output, const std::string& log) {
    return Child("plumb",
                 {Stage::Binary("plumb"), "launch", stage.robot_folder, "--lcm-url", lcm_url,
                  "--bus", bus, "--output", stage.folder / output},
                 stage.folder / log);
  };
  const std::string lcm = stage.lcm_url, bus = stage.bus_url;
  std::vector<Child> runs;
  SECTION("the bus") {
    runs.push_back(launch("memq://", bus, "a", "a.log"));
    runs.push_back(launch("memq://", bus, "b", "b.log"));
    OneIsRefused(runs, "another run is under way on " + bus);
  }
  SECTION("the group") {
    runs.push_back(launch(lcm, "loop:", "a", "a.log"));
    runs.push_back(launch(lcm, "loop:", "b", "b.log"));
    OneIsRefused(runs, "another run is under way on " + lcm);
  }
  SECTION("the group, spelt otherwise") {
    runs.push_back(launch(lcm, "loop:", "a", "a.log"));
    runs.push_back(launch(lcm + "0", "loop:", "b", "b.log"));  // a larger buffer
    OneIsRefused(runs, "another run is under way on " + lcm.substr(0, lcm.find('?')));
  }
  SECTION("the folder") {
    runs.push_back(launch("memq://", "loop:", "a", "a.log"));
    runs.push_back(launch("memq://", "loop:", "a", "b.log"));
    OneIsRefused(runs, "in use by process");
  }
}

TEST_CASE("files of somebody else's are not written over by a record, nor by a run's own files") {
  Stage stage(133, "pendulum", Stage::Time::kReal);
  const fs::path own = stage.folder / "own";
  fs::create_directory(own);
  const auto write = [&](const fs::path& file) { std::ofstream(file) << "somebody's\n"; };
  const auto refused = [&](std::vector<std::string> arguments, const std::string& words) {
    arguments.insert(arguments.begin(), {Stage::Binary("plumb"), "--lcm-url", "memq://"});
    Child child("plumb", arguments, stage.folder / "child.log");
    REQUIRE(child.WaitFor(120));
    INFO(child.Tail(5));
    CHECK(child.ending() == "exit status 1");
    CHECK_THAT(child.Tail(5), Contains(words));
  };
  fs::copy(stage.robot_folder, own / "robot");
  const std::string toml = own / "robot" / "robot.toml", known = Read(toml);
  refused({"record", toml, "--robot", own / "robot"}, "is read, too");
  refused({"record", toml}, "is there and not an LCM log");
  fs::create_symlink(toml, own / "link");
  refused({"record", own / "link"}, "is there and not an LCM log");
  fs::create_directory(own / "run.d");
  write(own / "run.d" / "robot.toml");
  refused({"record", own / "run"}, "run.d: is there and no log's");
  CHECK(Read(own / "run.d" / "robot.toml") == "somebody's\n");
  CHECK(Read(toml) == known);

  const auto launch = [&](const fs::path& folder, const std::string& words) {
    refused({"launch", stage.robot_folder, "--bus", "loop:", "--output", folder}, words);
  };
  fs::create_directories(own / "a"), fs::create_directories(own / "b");
  fs::create_directories(own / "c");
  write(own / "thesis.txt");
  fs::create_symlink(own / "thesis.txt", own / "a" / "lock");
  launch(own / "a", "lock: Too many levels of symbolic links");
  write(own / "b" / "lock");
  launch(own / "b", "lock: is there and no run's");
  write(own / "c" / "clock");
  launch(own / "c", "clock: is there and no socket of ours");
  for (const char* file : {"thesis.txt", "b/lock", "c/clock"})
    CHECK(Read(own / file) == "somebody's\n");
}

}  // namespace
}  // namespace plumb
