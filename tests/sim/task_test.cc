#include "sim/tasks/task.h"

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numbers>

#include "sim/environment.h"
#include "tests/sim/robots.h"

namespace plumb {
namespace {

constexpr double kPi = std::numbers::pi;

Eigen::VectorXd Scalar(double x) { return Eigen::VectorXd::Constant(1, x); }

// Wherever the step leads: gym's Pendulum is paid for where it was.
double PendulumReward(const Task& task, double q, double v, double u) {
  return task.Reward(Scalar(q), Scalar(v), Scalar(u), Scalar(q + 1), Scalar(v - 1));
}

JointDescription Joint(const std::string& name, JointDescription::Type type, double lower, double upper,
                       double effort_limit) {
  JointDescription joint = LoadPendulum("robot.toml").joints[0];
  joint.name = name;
  joint.type = type;
  joint.lower = lower;
  joint.upper = upper;
  joint.effort_limit = effort_limit;
  joint.passive = effort_limit == 0;
  return joint;
}

using Type = JointDescription::Type;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

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

RobotDescription CartAndPole(const std::string& task) {
  RobotDescription description = LoadPendulum("robot.toml");
  description.task = {task, 0.02, 500};
  description.joints = {Joint("slide", Type::kPrismatic, -2, 2, 10), Joint("hinge", Type::kContinuous, -kInfinity, kInfinity, 0)};
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

TEST_CASE("an unknown task is answered with the nearest known one; one that does not fit is refused") {
  RobotDescription description = LoadPendulum("robot.toml");
  description.task.name = "pendulun";
  CHECK_THROWS_WITH(MakeTask(description), Catch::Contains("'pendulum'"));
  CHECK(TaskNames() == std::vector<std::string>{"pendulum", "hopper", "reach", "hold"});
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
    explicit Blind(const RobotDescription& description) : Task(description, 1, Eigen::VectorXd::Ones(9)) {}
    void Observe(const State&, const State&, std::span<float>) const override {}
    double Reward(const State&, const State&, const State&, const State&, const State&) const override { return 0; }
    void InitialState(Random&, Eigen::Ref<Eigen::VectorXd>, Eigen::Ref<Eigen::VectorXd>) const override {}
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
  CHECK(observation == std::array<float, 11>{1.1f, 0.1f, -0.4f, -0.3f, 0.2f, 1, -10, 3, 10, -4, 10});

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

TEST_CASE("reach: errors to the target, the short way round; a quadratic price") {
  RobotDescription description = CartAndPole("reach");
  description.task.target = {0.5, 3};
  const auto task = MakeTask(description);
  REQUIRE(task->observation_size() == 5);
  CHECK(task->action_size() == 1);
  std::array<float, 5> observation{};
  const Eigen::Vector2d q(-0.5, -3), v(0.25, -7);
  task->Observe(q, v, observation);
  const double turn = 2 * kPi - 6;  // from 3 to -3
  CHECK(observation[0] == -1);
  CHECK(observation[1] == Approx(std::sin(turn)));
  CHECK(observation[2] == Approx(std::cos(turn)));
  CHECK(observation[3] == 0.25f);
  CHECK(observation[4] == -7);
  // The slide's unit is half its range, 2 m; the effort is half its limit.
  const double price = 0.25 + turn * turn + 0.01 * (0.125 * 0.125 + 49) + 0.01 * 0.25;
  CHECK(task->Reward(q, v, Eigen::Vector2d(5, 0), q, v) == Approx(-price).epsilon(1e-12));
  CHECK(task->Reward(Eigen::Vector2d(0.5, 3 + 4 * kPi), 0 * v, 0 * v, q, v) == Approx(0).margin(1e-20));
  CHECK(task->state_scale() == Eigen::Vector4d(2, 1, 16, 8));
  CHECK_FALSE(task->Terminated(q, v));
}

TEST_CASE("reach starts anywhere, hold near the target, a spread rules both") {
  const auto extremes = [](const RobotDescription& description) {
    const auto task = MakeTask(description);
    Random random(8);
    Eigen::Vector4d result(kInfinity, -kInfinity, kInfinity, -kInfinity);
    Eigen::VectorXd q(2), v = Eigen::VectorXd::Ones(2);
    for (int i = 0; i < 3000; ++i) {
      task->InitialState(random, q, v);
      CHECK(v == Eigen::Vector2d::Zero());
      result << std::min(result[0], q[0]), std::max(result[1], q[0]), std::min(result[2], q[1]),
          std::max(result[3], q[1]);
    }
    return result;
  };
  RobotDescription reach = CartAndPole("reach"), hold = CartAndPole("hold");
  reach.task.target = hold.task.target = {0.5, 3};
  CHECK((extremes(reach) - Eigen::Vector4d(-2, 2, -kPi, kPi)).norm() < 0.02);
  CHECK(extremes(hold) == Eigen::Vector4d(0.5, 0.5, 3, 3));
  reach.task.spread = {0, 0.1};
  CHECK((extremes(reach) - Eigen::Vector4d(-2, 2, 2.9, 3.1)).norm() < 0.02);
  hold.task.spread = {1.75, 0.2};
  CHECK((extremes(hold) - Eigen::Vector4d(-1.25, 2, 2.8, 3.2)).norm() < 0.02);  // not beyond the limit
}

namespace {

/// A body in the air, floating, with a wheel.
RobotDescription FloatingBody(const std::string& task) {
  RobotDescription description = LoadPendulum("robot.toml");
  description.parameters.clear();
  description.virtual_robot.hidden.clear();
  description.simulation.gravity = 0;
  description.task = {task, 0.02, 100};
  const auto link = [](const std::string& name, double mass) {
    return LinkDescription{name, mass, Eigen::Vector3d::Zero(), 0.1 * mass * Eigen::Matrix3d::Identity()};
  };
  description.links = {{"base"}, {"x"}, {"y"}, {"z"}, link("body", 2), link("wheel", 0.5)};
  description.joints = {Joint("free/x", Type::kPrismatic, -kInfinity, kInfinity, 0),
                        Joint("free/y", Type::kPrismatic, -kInfinity, kInfinity, 0),
                        Joint("free/z", Type::kPrismatic, -kInfinity, kInfinity, 0),
                        Joint("free/rotation", Type::kSpherical, -kInfinity, kInfinity, 0),
                        Joint("wheel", Type::kContinuous, -kInfinity, kInfinity, 1)};
  for (int i = 0; i < 5; ++i) {
    JointDescription& joint = description.joints[static_cast<size_t>(i)];
    joint.parent = i;
    joint.child = i + 1;
    joint.origin.setZero();
    joint.rotation.setIdentity();
    joint.axis = Eigen::Vector3d::Unit(i % 3);
    joint.dynamics = {};
  }
  return description;
}

Eigen::Vector4d Turned(const Eigen::Quaterniond& target, const Eigen::Vector3d& vector) {
  const Eigen::Quaterniond q = target * Eigen::Quaterniond(Eigen::AngleAxisd(vector.norm(), vector.normalized()));
  return {q.w(), q.x(), q.y(), q.z()};
}

}  // namespace

TEST_CASE("reach: of a spherical joint the rotation vector to the target counts, whatever the quaternion's sign") {
  RobotDescription description = FloatingBody("hold");
  const Eigen::Quaterniond target(0.6, 0, 0.8, 0);
  description.task.target = {1, 2, 3, 0.6, 0, 0.8, 0, 0};
  const auto task = MakeTask(description);
  REQUIRE(task->observation_size() == 3 + 3 + 2 + 7);
  CHECK(task->action_indices() == std::vector<int>{6});
  CHECK(task->state_scale() == (Eigen::VectorXd(15) << 1, 1, 1, 1, 1, 1, 1, 1, 8, 8, 8, 8, 8, 8, 8).finished());

  const Eigen::VectorXd still = Eigen::VectorXd::Zero(7);
  Eigen::VectorXd q(8), v = still;
  q << 1, 2, 3, 0.6, 0, 0.8, 0, 0;
  const auto reward = [&](const Eigen::VectorXd& at) { return task->Reward(at, v, still, at, v); };
  CHECK(reward(q) == 0);
  for (const double size : {1e-9, 0.3, 3.0, kPi - 1e-6}) {
    const Eigen::Vector3d turn = size * Eigen::Vector3d(2, -1, 2) / 3;
    q.segment<4>(3) = Turned(target, turn);
    Eigen::VectorXd minus = q;
    minus.segment<4>(3) *= -1;
    CHECK(reward(q) == Approx(-size * size).epsilon(1e-6));
    CHECK(reward(minus) == reward(q));
    std::array<float, 15> one{}, other{};
    task->Observe(q, v, one);
    task->Observe(minus, v, other);
    CHECK(one == other);
    for (size_t i = 0; i < 3; ++i) CHECK(one[3 + i] == Approx(turn[static_cast<Eigen::Index>(i)]));
    CHECK(one[6] == 0);  // the wheel
    CHECK(one[7] == 1);
  }
  q.segment<4>(3) << 0.6, 0, 0.8, 0;
  v << 0, 0, 0, 1, 2, -2, 0;
  CHECK(reward(q) == Approx(-0.09));
}

TEST_CASE("reach turns a spherical joint anywhere, hold as far as its spread") {
  Random random(4);
  Eigen::VectorXd q(8), v(7);
  RobotDescription description = FloatingBody("reach");
  description.task.target = {0, 0, 0, 0.6, 0, 0.8, 0, 0};
  description.task.spread = {1, 1, 1, 0, 0, 0, 0, 0};
  const auto reach = MakeTask(description);
  Eigen::Matrix4d moments = Eigen::Matrix4d::Zero();
  for (int i = 0; i < 10000; ++i) {
    reach->InitialState(random, q, v);
    REQUIRE(q.segment<4>(3).norm() == Approx(1).epsilon(1e-12));
    moments += q.segment<4>(3) * q.segment<4>(3).transpose() / 10000;
  }
  CHECK((moments - Eigen::Matrix4d::Identity() / 4).cwiseAbs().maxCoeff() < 0.01);  // uniform on the sphere

  description.task.name = "hold";
  const auto hold = MakeTask(description);
  hold->InitialState(random, q, v);
  CHECK((q.segment<4>(3) - Eigen::Vector4d(0.6, 0, 0.8, 0)).norm() < 1e-15);

  description.task.spread.assign(8, 0.2);
  for (const char* name : {"hold", "reach"}) {
    description.task.name = name;
    const auto task = MakeTask(description);
    Eigen::Vector3d least = Eigen::Vector3d::Zero(), most = least;
    for (int i = 0; i < 2000; ++i) {
      task->InitialState(random, q, v);
      CHECK(v == Eigen::VectorXd::Zero(7));
      std::array<float, 15> seen{};
      task->Observe(q, v, seen);
      const Eigen::Vector3d turn(seen[3], seen[4], seen[5]);
      least = least.cwiseMin(turn);
      most = most.cwiseMax(turn);
    }
    CHECK((least.array() + 0.2).abs().maxCoeff() < 0.002);
    CHECK((most.array() - 0.2).abs().maxCoeff() < 0.002);
  }
}

TEST_CASE("hold: a floating body in an environment") {
  RobotDescription description = FloatingBody("hold");
  description.task.target = {0, 0, 1, 0.6, 0, 0.8, 0, 0};
  Environment environment(description);
  Random random(1);
  environment.Reset(random);
  Eigen::VectorXf observation(environment.observation_size()), action(1);
  environment.Observe(observation);
  CHECK(observation.cwiseAbs().sum() == Approx(1));  // the wheel's cosine
  // It rests at the target, until the wheel turns the body the other way.
  action << 0;
  for (int i = 0; i < 10; ++i) CHECK(environment.Step(action).reward == Approx(0).margin(1e-12));
  action << 1;
  for (int i = 0; i < 10; ++i) CHECK_FALSE(environment.Step(action).terminated);
  CHECK(environment.Step(action).reward < -0.011);
  environment.Observe(observation);
  CHECK(observation.allFinite());
  CHECK(observation.segment<3>(3).norm() > 0.01);
}

TEST_CASE("reach refuses what it cannot start from") {
  RobotDescription description = CartAndPole("reach");
  description.joints[0].lower = -kInfinity;
  CHECK_THROWS_WITH(MakeTask(description), Catch::Contains("'slide'") && Catch::Contains("task.spread"));
  description.task.spread = {0.1, 0};
  CHECK_NOTHROW(MakeTask(description));
}

}  // namespace plumb
