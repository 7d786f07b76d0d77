#include "sim/tasks/balance.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "tests/sim/joints.h"

namespace plumb {
namespace {

RobotDescription Balanced() {
  RobotDescription description = CartAndPole("balance");
  description.task.target = {0.5, 3};
  description.task.spread = {0.2, 0.1};
  description.task.fall = {1, 0.4};
  return description;
}

}  // namespace

TEST_CASE("balance: a step without a fall earns one, less a price of its effort") {
  const auto task = MakeTask(Balanced());
  const Eigen::Vector2d up(0.5, 3), v(0.1, -2), none(0, 0), half(5, 0);  // of 10 N
  CHECK(task->Reward(up, v, none, up, v) == 1);
  CHECK(task->Reward(up, v, half, up, v) == Approx(1 - 0.01 * 0.25).epsilon(1e-12));
  const Eigen::Vector2d down(0.5, 3.5);
  CHECK(task->Reward(up, v, half, down, v) == Approx(-0.01 * 0.25).epsilon(1e-12));
  // What counts is where the step ends.
  CHECK(task->Reward(down, v, none, up, v) == 1);
  CHECK(task->observation_names() == MakeTask(CartAndPole("hold"))->observation_names());
}

TEST_CASE("balance ends beyond the fall, the short way round") {
  RobotDescription description = Balanced();
  const auto ends = [&](double slide, double hinge, double v = 0) {
    return MakeTask(description)->Terminated(Eigen::Vector2d(slide, hinge), Eigen::Vector2d(v, 0));
  };
  CHECK_FALSE(ends(0.5, 3));
  CHECK_FALSE(ends(-0.499, 3.399));
  CHECK(ends(-0.501, 3));
  CHECK(ends(1.501, 3));
  CHECK(ends(0.5, 3.401));
  CHECK(ends(0.5, 2.599));
  CHECK_FALSE(ends(0.5, -3));  // 0.283 from 3
  CHECK_FALSE(ends(0.5, 3 - 20 * kPi));
  CHECK(ends(std::nan(""), 3));
  CHECK(ends(0.5, 3, kInfinity));
  description.task.fall = {0, 0.4};  // the slide cannot fall
  CHECK_FALSE(ends(-100, 3));
  CHECK(ends(-100, 2));
}

TEST_CASE("a spherical joint has fallen by the angle of its rotation") {
  RobotDescription description = Balanced();
  description.joints = {Joint("slide", Type::kPrismatic, -2, 2, 10),
                        Joint("ball", Type::kSpherical, -kInfinity, kInfinity, 0)};
  description.task.target = {0, 1, 0, 0, 0};
  description.task.spread = {0, 0.2, 0.2, 0.2, 0.2};
  description.task.fall = {0, 0.5, 0.5, 0.5, 0.5};
  const auto task = MakeTask(description);
  const auto ends = [&](double angle, const Eigen::Vector3d& axis) {
    const Eigen::Vector3d part = std::sin(angle / 2) * axis.normalized();
    Eigen::VectorXd q(5);
    q << 0, std::cos(angle / 2), part;
    return task->Terminated(q, Eigen::VectorXd::Zero(4));
  };
  CHECK_FALSE(ends(0.499, {1, 2, -1}));
  CHECK(ends(0.501, {1, 2, -1}));
  CHECK(ends(-0.501, {0, 0, 1}));
  CHECK_FALSE(ends(2 * kPi - 0.499, {0, 1, 0}));
  description.task.spread = {0, 0.3, 0.3, 0.3, 0.3};  // its corner is 0.52 away
  CHECK_THROWS_WITH(MakeTask(description), Catch::Contains("'ball' may begin fallen"));
}

TEST_CASE("balance begins near the target, never fallen; it must be told of a fall") {
  RobotDescription description = Balanced();
  const auto task = MakeTask(description);
  Random random(3);
  Eigen::VectorXd q(2), v(2);
  for (int i = 0; i < 1000; ++i) {
    task->InitialState(random, q, v);
    CHECK_FALSE(task->Terminated(q, v));
    CHECK(std::abs(q[1] - 3) <= 0.1);
  }
  description.task.fall = {1, 0.1};
  CHECK_THROWS_WITH(MakeTask(description), Catch::Contains("'hinge' may begin fallen"));
  description.task.fall = {};
  CHECK_THROWS_WITH(MakeTask(description), Catch::Contains("needs a task.fall"));
}

TEST_CASE("the cart-pole's balance.toml has what its comments say") {
  const RobotDescription robot = LoadRobot(SourceFile("robots/cartpole/balance.toml"));
  CHECK(robot.task.name == "balance");
  CHECK(robot.task.steps == 500);  // of robot.toml
  CHECK(robot.task.spread == std::vector<double>{0.2, 0.1});
  CHECK(robot.task.fall == std::vector<double>{1.5, 0.4});
  const auto task = MakeTask(robot);
  CHECK_FALSE(task->Terminated(Eigen::Vector2d(1.4, 0.39), Eigen::Vector2d::Zero()));
  CHECK(task->Terminated(Eigen::Vector2d(0, 0.41), Eigen::Vector2d::Zero()));
}

}  // namespace plumb
