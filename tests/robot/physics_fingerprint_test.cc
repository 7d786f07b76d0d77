#include "robot/physics_fingerprint.h"

#include <catch2/catch.hpp>

#include "tests/robot/zoo.h"

namespace plumb {
namespace {

TEST_CASE("a latency is part of the physics, and none is as if it had never been one") {
  const RobotFolder folder(kZooUrdf, kZooToml);
  RobotDescription robot = LoadRobot(folder.path());
  REQUIRE(robot.simulation.latency == 0);
  const uint64_t without = PhysicsFingerprint(robot);
  robot.simulation.latency = 0.004;
  const uint64_t with = PhysicsFingerprint(robot);
  CHECK(with != without);
  robot.simulation.latency = 0.008;
  CHECK(PhysicsFingerprint(robot) != with);
  robot.simulation.latency = -0.0;
  CHECK(PhysicsFingerprint(robot) == without);
}

}  // namespace
}  // namespace plumb
