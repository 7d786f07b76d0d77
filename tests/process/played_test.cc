// What plumb launch runs in place of the loop: a table of efforts, or a policy learnt before.

#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/process/launch.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Catch::Contains;

TEST_CASE("an excitation is played on the robot and calibrated with, without any policy") {
  Stage stage(122, "pendulum", Stage::Time::kReal);
  const fs::path table = stage.folder / "efforts.csv", summary_file = stage.folder / "summary.json";
  const RobotDescription robot = LoadRobot(stage.robot_folder);
  std::string csv = "t,u/pivot\n";
  for (int k = 0; k < 100; ++k)
    csv += fmt::format("{},{}\n", k * robot.task.period, 1.8 * std::sin(0.3 * k));
  std::ofstream(table) << csv;
  Child launch = Launch(stage, {"--efforts", table, "--seed", "3", "--summary", summary_file});
  const std::string said = Finish(stage, launch);
  CHECK(Left(stage) == 0);
  CHECK_FALSE(fs::exists(stage.folder / "run" / "plumb-trainer.log"));
  const auto summary = nlohmann::json::parse(Read(summary_file));
  REQUIRE(summary.at("iterations").size() == 1);
  const auto& found = summary.at("iterations")[0];
  CHECK(found.at("transitions") >= 90);
  // What a pendulum's motion tells of is gravity / length.
  const auto& combination = found.at("combinations")[0];
  const double mean = combination.at("mean"), sd = combination.at("sd"),
               hidden = combination.at("hidden");
  CHECK(std::abs(mean / hidden - 1) < 0.02);
  CHECK(sd < 0.05 * mean);
  CHECK(summary.at("policy").is_null());

  std::ofstream(table) << "t,u/pivot\n0,3\n";  // more than the motor has
  Child refused = Launch(stage, {"--efforts", table}, "refused");
  stage.WaitUntil([&] { return !refused.running(); }, kLong);
  CHECK(refused.failed());
  CHECK_THAT(refused.Tail(20), Contains("efforts.csv:2: u/pivot is 3: beyond the joint's effort"));
}

TEST_CASE("a policy of a file runs on the robot, and nothing is learnt") {
  Stage stage(134, "pendulum", Stage::Time::kReal);
  LearnLittle(stage);
  Child learnt =
      Launch(stage, {"--iterations", "1", "--evaluation-episodes", "1", "--seed", "3"}, "learnt");
  Finish(stage, learnt);
  const fs::path policy = stage.folder / "learnt" / "training" / "trainer.checkpoint",
                 report = stage.folder / "report.html";
  const auto play = [&](const std::string& name) {
    const fs::path summary = stage.folder / (name + ".json");
    Child launch = Launch(stage,
                          {"--policy", policy, "--evaluation-episodes", "3", "--seed", "3",
                           "--summary", summary, "--report", report},
                          name);
    CHECK_THAT(Finish(stage, launch), Contains("final policy on the robot, 3 roll-outs: mean"));
    CHECK_FALSE(fs::exists(stage.folder / name / "plumb-calibrator.log"));
    return nlohmann::json::parse(Read(summary));
  };
  const auto summary = play("first");
  CHECK(Left(stage) == 0);
  CHECK(summary.at("iterations").empty());
  CHECK(summary.at("policy").is_null());
  REQUIRE(summary.at("evaluation_returns").size() == 3);
  CHECK_THAT(Read(report), Contains("of 3 roll-outs"));
  CHECK(play("again").at("evaluation_returns") == summary.at("evaluation_returns"));

  stage.Start("plumb-trainer", {"--policy", policy});
  controller_status_t complete{};  // of a controller that has played it
  complete.phase = controller_status_t::COMPLETE;
  complete.purpose = policy_t::EVALUATE;
  Publisher<controller_status_t> controller(stage.messenger, "CONTROLLER_STATUS");
  const auto told = [&] {
    return Contains("has been played already").match(stage.Log("plumb-trainer"));
  };
  for (int i = 0; i < 300 && !told(); ++i) {
    controller.Publish(complete);
    stage.Listen(0.1);
  }
  CHECK(told());
  stage.Kill("plumb-trainer");

  std::ofstream(policy) << "no policy";
  Child refused = Launch(stage, {"--policy", policy}, "refused");
  stage.WaitUntil([&] { return !refused.running(); }, kLong);
  CHECK(refused.failed());
  CHECK_THAT(refused.Tail(20),
             Contains("trainer.checkpoint: is neither a trainer's checkpoint nor an ONNX model"));
}

}  // namespace
}  // namespace plumb
