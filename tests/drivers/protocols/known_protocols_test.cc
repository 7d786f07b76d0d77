#include "drivers/protocols/known_protocols.h"

#include <catch2/catch.hpp>

#include "tests/replaced.h"
#include "tests/robot/zoo.h"

namespace plumb {
namespace {

using Catch::Contains;
using Catch::EndsWith;

std::string Complaint(const std::string& protocol) {
  const RobotFolder folder(
      kZooUrdf, Replaced(kZooToml, "protocol = \"cansimple\"", "protocol = \"" + protocol + "\""));
  const RobotDescription robot = LoadRobot(folder.path());
  std::string complaint;
  try {
    RequireProtocols(robot);
  } catch (const std::invalid_argument& error) {
    complaint = error.what();
  }
  return complaint;
}

TEST_CASE("a motor's protocol that there is not is told with its place, and what may be meant") {
  CHECK(Complaint("cansimple").empty());
  CHECK_THAT(Complaint("cansimpel"),
             Contains("robot.toml:16:12: joint hip: unknown motor protocol 'cansimpel'; known: "
                      "cansimple, moteus, mit, rmd; did you mean cansimple?"));
  CHECK_THAT(Complaint("ODrive"), EndsWith("; ODrive speaks cansimple"));
  CHECK_THAT(Complaint("RMD"), EndsWith("; did you mean rmd?"));
  CHECK_THAT(Complaint("dynamixel"), EndsWith("known: cansimple, moteus, mit, rmd"));
  CHECK_THAT(Complaint("cia402"), EndsWith("drives (CiA 402) are not"));
}

TEST_CASE("so is a sensor's") {
  const RobotFolder folder(kZooUrdf, kZooToml);
  RobotDescription robot = LoadRobot(folder.path());
  robot.sensors.push_back({.name = "imu", .protocol = "MTi"});
  CHECK_THROWS_WITH(RequireProtocols(robot),
                    Catch::StartsWith("sensor imu: unknown sensor protocol 'MTi'; known: ") &&
                        EndsWith("; MTi speaks xsens"));
}

}  // namespace
}  // namespace plumb
