#include "sim/tasks/task.h"

#include <array>
#include <catch2/catch.hpp>
#include <cmath>

#include "sim/environment.h"
#include "tests/sim/joints.h"
#include "tests/sim/scalar.h"

namespace plumb {
namespace {

// Wherever the step leads: gym's Pendulum is paid for where it was.
double PendulumReward(const Task& task, double q, double v, double u) {
  return task.Reward(Scalar(q), Scalar(v), Scalar(u), Scalar(q + 1), Scalar(v - 1));
}

/// gym's Hopper as far as tasks know robots.
RobotDescription HopperJoints() {
  RobotDescription description = LoadPendulum("robot.toml");
  description.task = {"hopper", 0.008, 1000};
  description.joints = {Joint("rootx", Type::kPrismatic, -kInfinity, kInfinity, 0),
                        Joint("rootz", Type::kPrismatic, -kInfinity, kInfinity, 0),
                        Joint("rooty", Type::kContinuous, -kInfinity, kInfinity, 0),
                        Joint("thigh", Type::kRevolute, -2.6, 0, 200),
                        Joint("leg", Type::kRevolute, -2.6, 0, 200),
                        Joint("foot", Type::kRevolute, -0.8, 0.8, 200)};
  return description;
}

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

  CHECK(PendulumReward(*task, 0, 0, 0) == 0);
  CHECK(PendulumReward(*task, 1, 2, -2) == Approx(-(1 + 0.4 + 0.004)).epsilon(1e-14));
  // The angle counts from upright the short way round, however often it has turned.
  for (const int turns : {-30, -1, 0, 1, 5}) {
    CHECK(PendulumReward(*task, 2 * kPi * turns + 3, 0, 0) == Approx(-9).epsilon(1e-12));
    CHECK(PendulumReward(*task, 2 * kPi * turns - 3, 0, 0) == Approx(-9).epsilon(1e-12));
  }
  // The worst reward that gym's documentation states.
  CHECK(PendulumReward(*task, kPi, 8, 2) == Approx(-16.2736044).epsilon(1e-8));
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
  CHECK(task->action_names() == std::vector<std::string>{"pivot"});
  CHECK(task->action_unit(0) == 1);  // people count Nm
  const std::array<float, 2> two{};
  CHECK_THROWS_AS(task->Effort(two, effort), std::invalid_argument);
}

TEST_CASE(
    "an unknown task is answered with the nearest known one; one that does not fit is refused") {
  RobotDescription description = LoadPendulum("robot.toml");
  description.task.name = "pendulun";
  CHECK_THROWS_WITH(MakeTask(description), Catch::Contains("'pendulum'"));
  CHECK(TaskNames() == std::vector<std::string>{"pendulum", "hopper", "reach", "hold", "balance",
                                                "walk", "stand"});
  RobotDescription tree = MakeTree();
  CHECK_THROWS_AS(MakeTask(tree), std::invalid_argument);
}

TEST_CASE("only what has a motor is driven") {
  const auto task = MakeTask(HopperJoints());
  REQUIRE(task->action_size() == 3);
  CHECK(task->action_names() == std::vector<std::string>{"thigh", "leg", "foot"});
  CHECK(task->action_indices() == std::vector<int>{3, 4, 5});
  CHECK(task->action_unit(1) == 200);  // gym's custom: -1 to 1
  Eigen::VectorXd effort = Eigen::VectorXd::Constant(6, 7);
  task->Effort(std::array<float, 3>{0.5f, -2, std::numeric_limits<float>::quiet_NaN()}, effort);
  CHECK(effort == (Eigen::VectorXd(6) << 0, 0, 0, 100, -200, 0).finished());
  Eigen::VectorXd per_motor(3);
  CHECK_THROWS_AS(task->Effort(std::array<float, 3>{}, per_motor), std::invalid_argument);

  // Behind a spherical joint, which has three velocities.
  RobotDescription arm = CartAndPole("reach");
  arm.joints[0] = Joint("ball", Type::kSpherical, 0, 0, 0);
  arm.joints[1] = Joint("elbow", Type::kRevolute, -1, 1, 3);
  struct Blind : Task {
    explicit Blind(const RobotDescription& description)
        : Task(description, {"nothing"}, Eigen::VectorXd::Ones(9)) {}
    void Observe(const State&, const State&, std::span<float>) const override {}
    double Reward(const State&, const State&, const State&, const State&,
                  const State&) const override {
      return 0;
    }
    void InitialState(Random&, Eigen::Ref<Eigen::VectorXd>,
                      Eigen::Ref<Eigen::VectorXd>) const override {}
  };
  const Blind blind(arm);
  Eigen::VectorXd four(4);
  blind.Effort(std::array<float, 1>{-1}, four);
  CHECK(four == Eigen::Vector4d(0, 0, 0, -3));
  arm.joints[0].passive = false;
  CHECK_THROWS_WITH(Blind(arm), Catch::Contains("'ball'"));
}

TEST_CASE("the hopper's observation, reward and end are gym's") {
  const auto task = MakeTask(HopperJoints());
  REQUIRE(task->observation_size() == 11);
  Eigen::VectorXd q(6), v(6);
  q << 5, 1.1, 0.1, -0.4, -0.3, 0.2;
  v << 1, -11, 3, 12, -4, 10;
  std::array<float, 11> observation{};
  task->Observe(q, v, observation);
  CHECK(observation ==
        std::array<float, 11>{1.1f, 0.1f, -0.4f, -0.3f, 0.2f, 1, -10, 3, 10, -4, 10});

  // 8 mm in 8 ms, one for being alive, and a thousandth of 0.5^2 + 1 + 0
  Eigen::VectorXd effort(6), next = q;
  effort << 0, 0, 0, 100, -200, 0;
  next[0] += 0.008;
  CHECK(task->Reward(q, v, effort, next, v) == Approx(1 + 1 - 1.25e-3).epsilon(1e-12));
  next[0] = q[0] - 0.016;
  CHECK(task->Reward(q, v, 0 * effort, next, v) == Approx(-2 + 1).epsilon(1e-12));

  CHECK_FALSE(task->Terminated(q, v));
  const auto ends_at = [&](int index, double value) {
    Eigen::VectorXd other_q = q, other_v = v;
    (index < 6 ? other_q[index] : other_v[index - 6]) = value;
    return task->Terminated(other_q, other_v);
  };
  CHECK_FALSE(ends_at(0, 1e5));  // how far it went does not matter
  CHECK_FALSE(ends_at(1, 1e5));  // nor how high
  CHECK_FALSE(ends_at(1, 0.7001));
  CHECK(ends_at(1, 0.7));
  CHECK_FALSE(ends_at(2, -0.1999));
  CHECK(ends_at(2, 0.2));
  CHECK(ends_at(2, -0.2));
  CHECK_FALSE(ends_at(3, -99.9));
  CHECK(ends_at(3, -100));
  CHECK(ends_at(6, 100));
  CHECK(ends_at(11, -1000));
  for (int i = 0; i < 12; ++i) {
    CHECK(ends_at(i, std::numeric_limits<double>::quiet_NaN()));
    CHECK(ends_at(i, kInfinity));
  }
  CHECK(task->state_scale().size() == 12);
  CHECK((task->state_scale().array() > 0).all());
}

TEST_CASE("the hopper starts standing, all but still") {
  const auto task = MakeTask(HopperJoints());
  Random random(3);
  Eigen::VectorXd q(6), v(6), stand = Eigen::VectorXd::Zero(6), most = stand;
  stand[1] = 1.25;
  for (int i = 0; i < 1000; ++i) {
    task->InitialState(random, q, v);
    CHECK(((q - stand).array().abs() <= 0.005).all());
    CHECK((v.array().abs() <= 0.005).all());
    most = most.cwiseMax((q - stand).cwiseAbs());
  }
  CHECK((most.array() > 0.0049).all());
}

TEST_CASE("only a hopper can hop") {
  RobotDescription description = HopperJoints();
  description.joints[3].passive = true;
  CHECK_THROWS_WITH(MakeTask(description), Catch::Contains("hopper"));
  description = HopperJoints();
  description.joints.pop_back();
  CHECK_THROWS_AS(MakeTask(description), std::invalid_argument);
}

}  // namespace plumb
