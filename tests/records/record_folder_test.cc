#include "records/record_folder.h"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>

#include "common/config.h"
#include "common/message_bytes.h"
#include "common/message_type.h"
#include "records/message_definitions.h"
#include "robot/parameter_distribution.h"
#include "robot/physics_fingerprint.h"
#include "tests/replaced.h"
#include "tests/robot/zoo.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

std::string Robots() { return std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/"; }

TEST_CASE("a log's folder has the robot, whatever its file extends, to the last number") {
  const TemporaryFolder folder;
  const std::string log = folder / "run.lcmlog";
  const std::string file =
      GENERATE("pendulum", "pendulum/worn_weak.toml", "hopper", "hopper/mit.toml",
               "hopper/moteus.toml", "cartpole/balance.toml");
  INFO(file);
  using About = RecordFolder::About;
  std::optional<RecordFolder> record(std::in_place, log,
                                     About{"plumb 1", "plumb record", "", "real", Robots() + file});
  const RobotDescription was = LoadRobot(Robots() + file), is = LoadRobot(log + ".d");
  CHECK(is.name == was.name);
  CHECK(PhysicsFingerprint(is) == PhysicsFingerprint(was));
  CHECK(UrlsOf(is.buses) == UrlsOf(was.buses));
  CHECK(is.warnings.size() == was.warnings.size());
  const Gaussian prior_is = PriorGaussian(is), prior_was = PriorGaussian(was);
  CHECK(prior_is.mean == prior_was.mean);
  record.reset();
  record.emplace(log, About{"plumb 1", "plumb record", "", "real", log + ".d"});  // over itself
  CHECK(PhysicsFingerprint(LoadRobot(log + ".d")) == PhysicsFingerprint(was));
}

TEST_CASE("a log's folder has the robot's collision meshes") {
  const RobotFolder robot(Replaced(kZooUrdf, "thigh.dae", "leg/thigh.obj"), kZooToml);
  fs::create_directory(robot.path() + "/leg");
  std::ofstream(robot.path() + "/leg/thigh.obj")
      << "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n";
  const RobotDescription was = LoadRobot(robot.path());
  REQUIRE(was.meshes.size() == 1);
  const TemporaryFolder folder;
  const std::string log = folder / "run.lcmlog";
  const RecordFolder::About about{"plumb 1", "plumb record", "", "real", robot.path()};
  std::optional<RecordFolder> record(std::in_place, log, about);
  fs::remove_all(robot.path() + "/leg");
  CHECK(PhysicsFingerprint(LoadRobot(log + ".d")) == PhysicsFingerprint(was));
  record.reset();
  record.emplace(log, RecordFolder::About{"plumb 1", "", "", "real", log + ".d"});  // over itself
  CHECK(PhysicsFingerprint(LoadRobot(log + ".d")) == PhysicsFingerprint(was));
  record.reset();
  record.emplace(log, RecordFolder::About{"plumb 1", "", "", "real", ""});
  CHECK_FALSE(fs::exists(log + ".d/meshes"));
}

TEST_CASE("what was recorded is said, and what an earlier recording has left is gone") {
  const TemporaryFolder folder;
  const std::string log = folder / "run.lcmlog";
  { const RecordFolder first(log, {"plumb 1", "one", "", "real", Robots() + "pendulum"}); }
  REQUIRE(fs::exists(log + ".d/robot.toml"));
  const RecordFolder second(log, {"plumb 2", "two \"quoted\"", "a note", "virtual", ""});
  CHECK_FALSE(fs::exists(log + ".d/robot.toml"));
  const auto record = nlohmann::json::parse(ReadFile(log + ".d/record.json"));
  CHECK(record.at("log") == "run.lcmlog");
  CHECK(record.at("program") == "plumb 2");
  CHECK(record.at("command") == "two \"quoted\"");
  CHECK(record.at("note") == "a note");
  CHECK(record.at("clock") == "virtual");
  CHECK(record.at("robot").is_null());
  CHECK(record.at("begun").get<std::string>().size() == 20);
}

TEST_CASE("the newest distribution of the parameters is kept, and nothing that is none") {
  const TemporaryFolder folder;
  const std::string log = folder / "run.lcmlog", file = log + ".d/parameter_distribution.json";
  RecordFolder record(log, {"plumb 1", "", "", "real", ""});
  parameter_distribution_t message =
      ParameterDistribution::Prior(LoadRobot(Robots() + "pendulum")).ToMessage();
  const auto say = [&](const std::string& channel) { record.Hear(channel, Encode(message)); };
  say("ROBOT_STATE");
  CHECK_FALSE(fs::exists(file));
  record.Hear("PARAMETER_DISTRIBUTION", std::vector<uint8_t>(100));
  CHECK_FALSE(fs::exists(file));
  for (const int iteration : {0, 1, 1}) {
    message.iteration = iteration;
    say("PARAMETER_DISTRIBUTION");
  }
  const auto json = nlohmann::json::parse(ReadFile(file));
  CHECK(json.at("iteration") == 1);
  CHECK(json.at("name") == nlohmann::json(message.name));
  // It is repeated once a second: the disk is left alone.
  fs::remove(file);
  say("PARAMETER_DISTRIBUTION");
  CHECK_FALSE(fs::exists(file));
}

TEST_CASE("what messages mean is beside the log: all that go over LCM") {
  const TemporaryFolder folder;
  const std::string log = folder / "run.lcmlog";
  const RecordFolder record(log, {"plumb 1", "", "", "real", ""});
  size_t ours = 0;
  for (const MessageType& type : MessageTypes()) {
    if (type.name.starts_with("lockstep_")) continue;
    ++ours;
    INFO(type.name);
    CHECK(
        ReadFile(log + ".d/lcmtypes/" + type.name + ".lcm") ==
        ReadFile(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/lcmtypes/" + type.name + ".lcm"));
  }
  CHECK(MessageDefinitions().size() == ours);
}

TEST_CASE("a folder that cannot be made, and a robot that cannot be read, are named") {
  const TemporaryFolder folder;
  const std::string log = folder / "run.lcmlog";
  CHECK_THROWS_WITH(RecordFolder(log, {"", "", "", "", folder / "none"}),
                    folder / "none" + ": there is no such robot");
  std::ofstream(folder / "file") << "a file";
  CHECK_THROWS_WITH(RecordFolder(folder / "file/run", {}),
                    Catch::StartsWith(folder / "file/run.d: cannot be made: "));
}

TEST_CASE("what somebody else has where a log's folder is to be stays as it is") {
  const TemporaryFolder folder;
  const std::string log = folder / "run", words = log + ".d: is there and no log's";
  std::ofstream(log + ".d") << "a file";
  CHECK_THROWS_WITH(RecordFolder(log, {}), Catch::StartsWith(words));
  fs::remove(log + ".d");
  fs::create_directory(log + ".d");
  std::ofstream(log + ".d/robot.toml") << "somebody's";
  CHECK_THROWS_WITH(RecordFolder(log, {}), Catch::StartsWith(words));
  CHECK(ReadFile(log + ".d/robot.toml") == "somebody's");
  fs::remove(log + ".d/robot.toml");
  const RecordFolder first(log, {});  // an empty folder may be anybody's
  CHECK_THROWS_WITH(RecordFolder(log, {}), log + ": is being written already");
}

}  // namespace
}  // namespace plumb
