// How a run ends before its time: stopped by a person, or a process of it killed.

#include "tests/process/launch.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Catch::Contains;
using Catch::StartsWith;

/// To the run's process of that name.
void Signal(const Stage& stage, const std::string& process, int signal) {
  for (const auto& entry : fs::directory_iterator("/proc")) {
    const std::string line = Read(entry.path() / "cmdline");
    if (line.find(stage.lcm_url) != std::string::npos && line.find(process) != std::string::npos)
      kill(std::atoi(entry.path().filename().c_str()), signal);
  }
}

TEST_CASE("Ctrl-C stops everything, motors disarmed, nothing left") {
  Stage stage(31, "pendulum", Stage::Time::kReal);
  const std::string can_log = stage.folder / "can.log";
  bool in_an_episode = false, impatient = false;
  SECTION("while training") {}
  SECTION("in an episode, with torque on the bus") { in_an_episode = true; }
  SECTION("and again, by an impatient hand") { impatient = true; }
  std::vector<std::string> flags{"--can-log", can_log};
  if (in_an_episode) {
    LearnLittle(stage);
    flags.insert(flags.end(), {"--iterations", "1000"});
  }
  Child launch = Launch(stage, flags);
  REQUIRE(stage.WaitForDriver(driver_status_t::ARMED, kLong));
  if (in_an_episode) REQUIRE(stage.WaitUntil([&] { return stage.torque != 0; }, kLong));
  if (impatient) launch.Signal(SIGINT);
  launch.Signal(SIGINT);
  CHECK(stage.WaitUntil([&] { return !launch.running(); }, kLong));
  CHECK(launch.ending() == "exit status 130");
  CHECK_THAT(LastFrame(can_log, "021"), StartsWith("0000000001"));
  if (const std::string torque = LastFrame(can_log, "02E"); !torque.empty())
    CHECK_THAT(torque, StartsWith("00000000"));
  CHECK(Left(stage) == 0);
}

TEST_CASE("a launcher that is killed takes everything with it") {
  Stage stage(32, "pendulum", Stage::Time::kReal);
  std::vector<std::string> flags{"--log", stage.folder / "run.lcmlog"};
  SECTION("in virtual time") {}
  SECTION("in real time") { flags.push_back("--real-time"); }
  Child launch = Launch(stage, flags);
  REQUIRE(stage.WaitForDriver(driver_status_t::ARMED, kLong));
  launch.Signal(SIGKILL);
  CHECK(stage.WaitUntil([&] { return Left(stage) == 0; }, kLong));
}

TEST_CASE("a process that is killed ends the run, which says so") {
  Stage stage(36, "pendulum", Stage::Time::kReal);
  Child launch = Launch(stage, {});
  REQUIRE(stage.WaitForDriver(driver_status_t::ARMED, kLong));
  Signal(stage, "plumb-estimator", SIGKILL);
  REQUIRE(stage.WaitUntil([&] { return !launch.running(); }, kLong));
  CHECK(launch.ending() == "exit status 1");
  CHECK_THAT(launch.Tail(10), Contains("plumb-estimator ended (killed by signal 9)"));
  CHECK(Left(stage) == 0);
}

TEST_CASE("what a person stops, the launcher does not start again") {
  Stage stage(33, "pendulum", Stage::Time::kReal);
  const std::string can_log = stage.folder / "can.log";
  Child launch = Launch(stage, {"--can-log", can_log});
  const std::string clock = "virtual:" + (stage.folder / "run" / "clock").string();
  REQUIRE(stage.WaitForDriver(driver_status_t::ARMED, kLong));
  const auto run = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), Stage::Binary("plumb"));
    Child request("plumb", arguments, stage.folder / "request.log");
    REQUIRE(stage.WaitUntil([&] { return !request.running(); }, kLong));
    INFO(request.Tail(5));
    CHECK_FALSE(request.failed());
  };
  SECTION("in the run: until it is armed again") {
    for (const char* stop : {"disarm", "estop"}) {
      INFO(stop);
      run({stop, "--clock", clock});
      const int64_t stopped = stage.drivers.newest().utime;
      REQUIRE(stage.WaitUntil([&] { return stage.drivers.newest().utime > stopped + 2'000'000; },
                              kLong));
      CHECK(stage.axis_state == 1);
      CHECK(stage.drivers.newest().state != driver_status_t::ARMED);
      run({"arm", "--clock", clock});
      CHECK(stage.WaitUntil([&] { return stage.axis_state == 8; }, kLong));
    }
    launch.Signal(SIGINT);
    CHECK(launch.WaitFor(kLong));
  }
  SECTION("from outside: for good") {
    const char* stop = GENERATE("disarm", "estop");
    const bool busy = GENERATE(false, true);  // the driver gets no turn for a second
    INFO(stop << (busy ? ", busy" : ""));
    if (busy) Signal(stage, "plumb-driver", SIGSTOP);
    Child request("plumb", {Stage::Binary("plumb"), stop, "--lcm-url", stage.lcm_url},
                  stage.folder / "stop.log");
    if (busy) stage.Listen(1), Signal(stage, "plumb-driver", SIGCONT);
    REQUIRE(stage.WaitUntil([&] { return !launch.running(); }, kLong));
    CHECK(launch.ending() == "exit status 1");
    CHECK_THAT(launch.Tail(5), Contains("somebody outside the run has asked for a stop"));
    // Idle; after an Estop with the error that says so.
    CHECK(LastFrame(can_log, "021").substr(8, 2) == "01");
    CHECK_THAT(LastFrame(can_log, "02E"), StartsWith("00000000"));
    // And whoever has asked is told.
    REQUIRE(stage.WaitUntil([&] { return !request.running(); }, kLong));
    INFO(request.Tail(5));
    CHECK_FALSE(request.failed());
    CHECK_THAT(request.Tail(5), Contains("not armed: "));
  }
}

}  // namespace
}  // namespace plumb
