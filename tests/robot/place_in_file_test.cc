#include "robot/place_in_file.h"

#include <catch2/catch.hpp>
#include <filesystem>

#include "tests/robot/zoo.h"

namespace plumb {
namespace {

TEST_CASE("what is found to be wrong later is told with its place in the file") {
  const RobotFolder folder(kZooUrdf, kZooToml);
  RobotDescription robot = LoadRobot(folder.path());
  const std::string file = folder.path() + "/robot.toml";
  CHECK(PlaceInFile(robot, "joint", "hip", "protocol") == file + ":16:12: ");
  CHECK(PlaceInFile(robot, "joint", "hop", "protocol").empty());
  CHECK(PlaceInFile(robot, "sensor", "imu", "protocol").empty());
  std::filesystem::remove(file);
  CHECK(PlaceInFile(robot, "joint", "hip", "protocol") == file + ": ");
  robot.file.clear();
  CHECK(PlaceInFile(robot, "joint", "hip", "protocol").empty());
}

}  // namespace
}  // namespace plumb
