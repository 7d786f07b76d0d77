// The whole loop with the real processes: plumb launch from the prior to an evaluated policy, and
// the same calibration again from its log.

#include <cmath>
#include <nlohmann/json.hpp>

#include "plumb/parameter_distribution_t.hpp"
#include "tests/process/launch.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Catch::Contains;
using Catch::StartsWith;

TEST_CASE("the loop closes, and its log gives the same distributions bit by bit") {
  Stage stage(30, "pendulum", Stage::Time::kReal);
  LearnLittle(stage);
  const fs::path summary_file = stage.folder / "summary.json", log = stage.folder / "run.lcmlog",
                 can_log = stage.folder / "can.log", report = stage.folder / "report.html";
  Child launch =
      Launch(stage, {"--iterations", "2", "--evaluation-episodes", "2", "--seed", "3", "--log", log,
                     "--can-log", can_log, "--summary", summary_file, "--report", report});
  Finish(stage, launch);
  CHECK(Left(stage) == 0);
  CHECK_THAT(LastFrame(can_log, "021"),
             StartsWith("0000000001"));  // the heartbeat of a drive that is disarmed

  // What it takes to understand the log is beside it.
  const fs::path beside = log.string() + ".d";
  CHECK(LoadRobot(beside).parameters.size() == 3);
  CHECK(nlohmann::json::parse(Read(beside / "parameter_distribution.json")).at("iteration") == 2);
  const auto record = nlohmann::json::parse(Read(beside / "record.json"));
  CHECK(record.at("clock") == "virtual");
  CHECK_THAT(record.at("command").get<std::string>(), Contains("--seed 3"));

  const auto summary = nlohmann::json::parse(Read(summary_file));
  CHECK(summary.at("seed") == 3);
  CHECK(summary.at("dropped_episodes") == 0);
  CHECK_THAT(Read(report), Contains("Policy 2 runs since iteration 2") && Contains("--seed 3"));
  REQUIRE(summary.at("iterations").size() == 2);
  CHECK(summary.at("hidden").size() == 3);
  CHECK(summary.at("evaluation_returns").size() == 2);
  for (const auto& iteration : summary.at("iterations")) {
    for (const char* key : {"mean", "sd", "discrepancy", "error", "kl", "simulated_return",
                            "robot_return", "seconds"}) {
      INFO(key);
      CHECK(iteration.contains(key));
      CHECK_FALSE(iteration.at(key).is_null());
    }
    CHECK(iteration.at("kl") > 0);
    CHECK(iteration.at("transitions") >= 150);
  }
  // Each roll-out has told which policy runs, and why: the model is right, so the newest does.
  CHECK(summary.at("policy").at("iteration") == 2);
  CHECK(summary.at("policy").at("since") == 2);
  CHECK_THAT(summary.at("policy").at("why").get<std::string>(), Contains("policy 2 trusted"));
  const auto& decisions = summary.at("decisions");
  REQUIRE(decisions.size() == 3);
  for (int k = 0; k <= 2; ++k) {
    CHECK(decisions[static_cast<size_t>(k)].at("policy") == k);
    CHECK(decisions[static_cast<size_t>(k)].at("accepted") == true);
    CHECK(decisions[static_cast<size_t>(k)].at("return").is_null() == (k == 2));  // is not tried
  }
  // Two iterations may not reach the truth, but they go towards it: more than halfway from the
  // prior. Which is known better, and comes first, depends on the motion.
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
    const double before = prior.at(name), learned = combination.at("mean"),
                 hidden = combination.at("hidden");
    INFO("prior " << before << ", learned " << learned << ", hidden " << hidden);
    CHECK(std::abs(learned - hidden) < 0.5 * std::abs(before - hidden));
  }
  CHECK(summary.at("identifiability").get<std::string>().find("not identifiable separately") !=
        std::string::npos);

  const std::vector<std::string> calibrator{Stage::Binary("plumb-calibrator"), stage.robot_folder,
                                            "--seed", "3"};
  const auto same = [&](const fs::path& folder) {
    for (int k = 1; k <= 2; ++k) {
      const std::string name = "posterior_" + std::to_string(k) + ".json";
      INFO(folder / name);
      const std::string live = Read(stage.folder / "run" / "calibration" / name);
      REQUIRE_FALSE(live.empty());
      CHECK(live == Read(folder / name));
    }
  };
  // From the log file, with another number of threads.
  auto arguments = calibrator;
  for (const std::string& flag :
       {std::string("--log"), log.string(), std::string("--checkpoint"),
        (stage.folder / "offline").string(), std::string("--threads"), std::string("1")}) {
    arguments.push_back(flag);
  }
  Child offline("offline", arguments, stage.folder / "offline.log");
  REQUIRE(offline.WaitFor(kLong));
  INFO(offline.Tail(10));
  REQUIRE_FALSE(offline.failed());
  same(stage.folder / "offline");

  Child other("other",
              {Stage::Binary("plumb-calibrator"),
               std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/servo", "--log", log,
               "--checkpoint", stage.folder / "other"},
              stage.folder / "other.log");
  REQUIRE(other.WaitFor(kLong));
  CHECK(other.failed());
  CHECK_THAT(other.Tail(10), Contains("run.lcmlog: is a log of pendulum, not of servo"));

  // The programs read the files that the run has left.
  const std::string posterior = stage.folder / "run/calibration/posterior_2.json";
  const std::vector<std::vector<std::string>> readers{
      {"train", stage.robot_folder, "--distribution", posterior, "--steps", "1e4", "--output",
       stage.folder / "policy.onnx"},
      {"excite", stage.robot_folder, "--posterior", posterior, "--candidates", "2", "--output",
       stage.folder / "excite.csv"},
      {"sim", stage.robot_folder, "--posterior", posterior}};
  for (const std::vector<std::string>& command : readers) {
    std::vector<std::string> line{Stage::Binary("plumb")};
    line.insert(line.end(), command.begin(), command.end());
    Child reader(command[0], line, stage.folder / (command[0] + ".log"));
    REQUIRE(reader.WaitFor(kLong));
    INFO(command[0] << "\n" << reader.Tail(10));
    CHECK_FALSE(reader.failed());
  }
}

/// All that a run leaves behind which must be the same, one after the other.
std::string Traces(const Stage& stage, const std::string& output) {
  std::string traces =
      Read(stage.folder / (output + ".lcmlog")) + Read(stage.folder / (output + ".can"));
  for (const char* file :
       {"summary.json", "calibration/posterior_1.json", "training/trainer.checkpoint"}) {
    const std::string trace = Read(stage.folder / output / file);
    INFO(file);
    REQUIRE_FALSE(trace.empty());
    traces += trace;
  }
  return traces;
}

TEST_CASE("the same run, every time: beside others, stopped now and then, without a network") {
  Stage stage(35, "pendulum", Stage::Time::kReal);
  LearnLittle(stage);
  const auto flags = [&](const std::string& output, std::vector<std::string> more = {}) {
    std::vector<std::string> all{"--iterations",
                                 "1",
                                 "--evaluation-episodes",
                                 "1",
                                 "--log",
                                 stage.folder / (output + ".lcmlog"),
                                 "--can-log",
                                 stage.folder / (output + ".can"),
                                 "--summary",
                                 stage.folder / output / "summary.json"};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  };
  Child first = Launch(stage, flags("first"), "first");
  Finish(stage, first);
  const std::string expected = Traces(stage, "first");

  {
    INFO("while its processes are stopped at any time");
    Child again = Launch(stage, flags("stopped"), "stopped");
    // Whoever belongs to it, one after the other, for a moment of real time.
    for (int round = 0; again.running(); ++round) {
      std::vector<pid_t> processes;
      for (const auto& entry : fs::directory_iterator("/proc")) {
        const pid_t pid = std::atoi(entry.path().filename().c_str());
        if (pid != 0 &&
            Read(entry.path() / "cmdline").find(stage.folder / "stopped") != std::string::npos)
          processes.push_back(pid);
      }
      if (processes.empty()) continue;
      const pid_t victim = processes[static_cast<size_t>(round) % processes.size()];
      kill(victim, SIGSTOP);
      stage.Listen(0.02);
      kill(victim, SIGCONT);
      stage.Listen(0.01);
    }
    Finish(stage, again);
    CHECK(Traces(stage, "stopped") == expected);
  }
  {
    INFO("beside processes that want the machine for themselves");
    std::vector<std::unique_ptr<Child>> others;
    for (int i = 0; i < 2; ++i) {
      others.push_back(
          std::make_unique<Child>("sh", std::vector<std::string>{"sh", "-c", "while :; do :; done"},
                                  stage.folder / "others.log"));
    }
    Child again = Launch(stage, flags("beside"), "beside");
    Finish(stage, again);
    CHECK(Traces(stage, "beside") == expected);
  }
  {
    INFO("on no bus and no network but its own");
    const std::string lcm = stage.lcm_url, bus = stage.bus_url;
    stage.lcm_url = "memq://";
    stage.bus_url = "loop:";
    Child again = Launch(stage, flags("alone"), "alone");
    Finish(stage, again);
    // Only what names the bus is another.
    CHECK(Read(stage.folder / "alone.can") == Read(stage.folder / "first.can"));
    CHECK(Read(stage.folder / "alone/calibration/posterior_1.json") ==
          Read(stage.folder / "first/calibration/posterior_1.json"));
    stage.lcm_url = lcm, stage.bus_url = bus;
  }
  {
    INFO("another seed is another run");
    Child other = Launch(stage, flags("other", {"--seed", "2"}), "other");
    Finish(stage, other);
    CHECK(Traces(stage, "other") != expected);
  }
  {
    INFO("what another run has left in the folder is refused before anything starts");
    const auto said = fs::file_size(stage.folder / "first/plumb-driver.log");
    Child other = Launch(stage, {"--iterations", "1", "--seed", "2"}, "first");
    REQUIRE(other.WaitFor(kLong));
    CHECK(other.ending() == "exit status 1");
    CHECK_THAT(other.Tail(1), Contains("calibration.checkpoint") && Contains("has another seed"));
    CHECK(fs::file_size(stage.folder / "first/plumb-driver.log") == said);
  }
}

TEST_CASE("who speaks from outside is named once, and not heard") {
  Stage stage(37, "pendulum", Stage::Time::kReal);
  LearnLittle(stage);
  Child launch = Launch(stage, {"--iterations", "1", "--evaluation-episodes", "1"});
  REQUIRE(stage.WaitForDriver(driver_status_t::ARMED, kLong));
  Publisher<joint_command_t> commands(stage.messenger, "JOINT_COMMAND");
  joint_command_t command{};
  command.num_joints = 1;
  command.effort = {1000};
  command.position = command.velocity = command.kp = command.kd = {NAN};
  const Frame frame = *FrameFromText("029#0000000000000000");
  while (launch.running()) {
    command.utime = stage.drivers.newest().utime;
    ++command.sequence;
    commands.Publish(command);
    stage.bus->Send({&frame, 1});
    stage.Listen(0.05);
  }
  const std::string output = Finish(stage, launch);
  CHECK_THAT(output, Contains("somebody outside the run says JOINT_COMMAND: not heard"));
  CHECK_THAT(output, Contains("029#0000000000000000 on " + stage.bus_url +
                              " is from outside the run, and ignored"));
  CHECK(output.find("not heard") == output.rfind("not heard"));
}

TEST_CASE("a second run beside the first, and a bus that may carry a real robot, are refused") {
  Stage stage(34, "pendulum", Stage::Time::kReal);
  const auto refusal = [&](const std::string& lcm_url, const std::string& bus_url,
                           const std::string& output) {
    Child second("plumb",
                 {Stage::Binary("plumb"), "launch", stage.robot_folder, "--lcm-url", lcm_url,
                  "--bus", bus_url, "--output", stage.folder / output},
                 stage.folder / ("second" + std::to_string(stage.frames) + ".log"));
    stage.WaitUntil([&] { return !second.running(); }, kLong);
    REQUIRE_FALSE(second.running());
    CHECK(second.failed());
    return second.Tail(5);
  };
  CHECK_THAT(refusal(stage.lcm_url, "socketcan:can0", "second"), Contains("--real"));
  Child launch = Launch(stage, {"--real-time"});
  REQUIRE(stage.WaitForDriver(driver_status_t::ARMED, kLong));
  stage.Listen(0.1);
  CHECK_THAT(refusal(stage.lcm_url, "udp:239.74.163.2:23260", "second"),
             Contains("another run is under way"));
  stage.Listen(0.1);
  CHECK_THAT(refusal("udpm://239.255.76.67:17760?ttl=0", stage.bus_url, "second"),
             Contains("another run is under way on " + stage.bus_url));
  stage.Listen(0.1);
  CHECK_THAT(refusal("udpm://239.255.76.67:17760?ttl=0", "udp:239.74.163.2:23260", "run"),
             Contains("in use by process " + std::to_string(launch.pid())));
  launch.Signal(SIGINT);
  CHECK(launch.WaitFor(kLong));
}

}  // namespace
}  // namespace plumb
