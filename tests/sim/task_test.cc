#include "sim/tasks/task.h"

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numbers>

#include "tests/sim/robots.h"

namespace plumb {
namespace {

constexpr double kPi = std::numbers::pi;

Eigen::VectorXd Scalar(double x) { return Eigen::VectorXd::Constant(1, x); }

}  // namespace

TEST_CASE("the pendulum's observation and reward are gym's") {
  const auto task = MakeTask(LoadPendulum("robot.toml"));
  REQUIRE(task->observation_size() == 3);
  REQUIRE(task->action_size() == 1);
  std::array<float, 3> observation{};
  task->Observe(Scalar(2), Scalar(-3), observation);
  CHECK(observation[0] == static_cast<float>(std::cos(2.0)));
  CHECK(observation[1] == static_cast<float>(std::sin(2.0)));
  CHECK(observation[2] == -3.0f);

  CHECK(task->Reward(Scalar(0), Scalar(0), Scalar(0)) == 0);
  CHECK(task->Reward(Scalar(1), Scalar(2), Scalar(-2)) == Approx(-(1 + 0.4 + 0.004)).epsilon(1e-14));
  // The angle counts from upright the short way round, however often it has turned.
  for (const int turns : {-30, -1, 0, 1, 5}) {
    CHECK(task->Reward(Scalar(2 * kPi * turns + 3), Scalar(0), Scalar(0)) == Approx(-9).epsilon(1e-12));
    CHECK(task->Reward(Scalar(2 * kPi * turns - 3), Scalar(0), Scalar(0)) == Approx(-9).epsilon(1e-12));
  }
  // The worst reward that gym's documentation states.
  CHECK(task->Reward(Scalar(kPi), Scalar(8), Scalar(2)) == Approx(-16.2736044).epsilon(1e-8));
  CHECK_FALSE(task->Terminated(Scalar(3), Scalar(100)));
  CHECK(task->state_scale() == Eigen::Vector2d(1, 8));
}

TEST_CASE("the pendulum starts anywhere, slowly") {
  const auto task = MakeTask(LoadPendulum("robot.toml"));
  Random random(5);
  Eigen::VectorXd q(1), v(1);
  double mean_square_q = 0, mean_square_v = 0;
  for (int i = 0; i < 10000; ++i) {
    task->InitialState(random, q, v);
    REQUIRE(std::abs(q[0]) <= kPi);
    REQUIRE(std::abs(v[0]) <= 1);
    mean_square_q += q[0] * q[0] / 10000;
    mean_square_v += v[0] * v[0] / 10000;
  }
  CHECK(mean_square_q == Approx(kPi * kPi / 3).epsilon(0.05));
  CHECK(mean_square_v == Approx(1.0 / 3).epsilon(0.05));
}

TEST_CASE("actions are clipped to the effort limits, and NaN is no effort") {
  const auto task = MakeTask(LoadPendulum("robot.toml"));
  Eigen::VectorXd effort(1);
  const auto of = [&](float action) {
    task->Effort(std::span(&action, 1), effort);
    return effort[0];
  };
  CHECK(of(0.25f) == 0.5);
  CHECK(of(1e30f) == 2);
  CHECK(of(-std::numeric_limits<float>::infinity()) == -2);
  CHECK(of(std::numeric_limits<float>::quiet_NaN()) == 0);
  const std::array<float, 2> two{};
  CHECK_THROWS_AS(task->Effort(two, effort), std::invalid_argument);
}

TEST_CASE("an unknown task is answered with the nearest known one; one that does not fit is refused") {
  RobotDescription description = LoadPendulum("robot.toml");
  description.task.name = "pendulun";
  CHECK_THROWS_WITH(MakeTask(description), Catch::Contains("'pendulum'"));
  CHECK(TaskNames() == std::vector<std::string>{"pendulum"});
  RobotDescription tree = MakeTree();
  CHECK_THROWS_AS(MakeTask(tree), std::invalid_argument);
}

}  // namespace plumb
