#include "experiments/oracle.h"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <functional>
#include <string>

#include "tests/temporary_folder.h"
#include "trainer/checkpoint.h"
#include "trainer/robot_simulation.h"

namespace plumb {
namespace {

RobotDescription SmallTask() {
  RobotDescription robot =
      LoadRobot(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/pendulum/robot.toml");
  robot.parameters.clear();
  robot.task.steps = 16;
  robot.training.batch = 64;
  robot.training.hidden = {4};
  return robot;
}

struct Stop {};
// Breaks off after so many updates.
std::function<void(double)> After(int updates) {
  return [=](double) mutable {
    if (--updates < 0) throw Stop();
  };
}

}  // namespace

TEST_CASE("an oracle that was interrupted goes on from its last judgement, to the same bits") {
  const TemporaryFolder folder;
  const RobotDescription robot = SmallTask();
  const auto train = [&](const std::string& file, const std::function<void(double)>& progress) {
    return TrainOracle(robot, SimulateRobot(robot), 3, 1, folder / file, 5, progress);
  };
  const Oracle whole = train("whole", [](double) {});
  CHECK(whole.updates >= kPatience);
  CHECK_THROWS_AS(train("parts", After(50)), Stop);
  CHECK(LoadCheckpoint(folder / "parts").value().updates == 40);
  int again = 0;
  const Oracle parts = train("parts", [&](double) { ++again; });
  CHECK(again == whole.updates - 40);
  CHECK(parts.updates == whole.updates);
  CHECK(parts.steps == whole.steps);
  CHECK(parts.policy.parameters == whole.policy.parameters);
}

TEST_CASE("an oracle does not go on from another robot's or seed's checkpoint") {
  const TemporaryFolder folder;
  const RobotDescription robot = SmallTask();
  const auto train = [&](uint64_t seed, uint64_t identity) {
    TrainOracle(robot, SimulateRobot(robot), seed, 1, folder / "oracle", identity, After(20));
  };
  CHECK_THROWS_AS(train(3, 5), Stop);
  CHECK_THROWS_WITH(train(4, 5),
                    Catch::Contains(folder / "oracle: of another robot, seed or version"));
  CHECK_THROWS_AS(train(3, 6), CheckpointError);
  CHECK_THROWS_AS(train(3, 5), Stop);
}

}  // namespace plumb
