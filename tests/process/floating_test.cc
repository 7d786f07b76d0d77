// Robots whose base nothing holds go the whole loop: IMU and legs tell where they are.

#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/process/launch.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Catch::Contains;
using nlohmann::json;

/// A run of one iteration. @return its summary.
json RunOnce(Stage& stage, std::vector<std::string> flags) {
  const fs::path summary = stage.folder / "summary.json";
  flags.insert(flags.end(), {"--iterations", "1", "--evaluation-episodes", "1", "--seed", "3",
                             "--summary", summary});
  Child launch = Launch(stage, flags);
  Finish(stage, launch);
  CHECK(Left(stage) == 0);
  return json::parse(Read(summary));
}

/// Every uncertain number has been learnt, and the robot has done something.
void HasLearnt(const json& summary, size_t parameters) {
  REQUIRE(summary.at("iterations").size() == 1);
  const json& iteration = summary.at("iterations")[0];
  CHECK(summary.at("dropped_episodes") == 0);
  CHECK(summary.at("hidden").size() == parameters);
  REQUIRE(iteration.at("mean").size() == parameters);
  for (size_t i = 0; i < parameters; ++i) {
    CHECK(std::isfinite(iteration.at("mean")[i].get<double>()));
    CHECK(iteration.at("sd")[i] > 0);
  }
  CHECK(iteration.at("transitions") >= 20);
  CHECK(iteration.at("robot_return") > 5);
  CHECK(summary.at("evaluation_returns")[0] > 5);
}

TEST_CASE("a hopper without a boom") {
  Stage stage(123, "hopper", Stage::Time::kReal);
  LearnLittle(stage, 1, 1, "free.toml");
  HasLearnt(RunOnce(stage, {}), 4);
}

TEST_CASE("a quadruped on four buses") {
  Stage stage(124, "quadruped", Stage::Time::kReal);
  const fs::path file = stage.folder / "robot.toml";
  std::ofstream(file) << fmt::format(
      "extends = \"{0}/robot.toml\"\n[robot]\nurdf = \"{0}/robot.urdf\"\n[task]\nsteps = "
      "50\n[training]\nupdates = 1\nupdates_again = 1\nbatch = 2000\n",
      stage.robot_folder);
  stage.robot_folder = file;
  stage.bus_url = "front_left=" + stage.bus_url;
  std::vector<std::string> buses;
  int port = 24740;
  for (const char* leg : {"front_right", "rear_left", "rear_right"})
    buses.insert(buses.end(), {"--bus", fmt::format("{}=udp:239.74.163.2:{}", leg, port++)});
  const json summary = RunOnce(stage, buses);
  HasLearnt(summary, 15);
  for (const char* leg : {"front_left", "front_right", "rear_left", "rear_right"})
    CHECK_THAT(summary.at("bus").dump(), Contains(leg));
}

}  // namespace
}  // namespace plumb
