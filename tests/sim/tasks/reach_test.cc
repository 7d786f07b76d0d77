#include "sim/tasks/reach.h"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>

#include "sim/environment.h"
#include "tests/sim/joints.h"

namespace plumb {

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
  CHECK(task->Reward(Eigen::Vector2d(0.5, 3 + 4 * kPi), 0 * v, 0 * v, q, v) ==
        Approx(0).margin(1e-20));
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
  // not beyond the limit
  CHECK((extremes(hold) - Eigen::Vector4d(-1.25, 2, 2.8, 3.2)).norm() < 0.02);
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
    return LinkDescription{name, mass, Eigen::Vector3d::Zero(),
                           0.1 * mass * Eigen::Matrix3d::Identity()};
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
  const Eigen::Quaterniond q =
      target * Eigen::Quaterniond(Eigen::AngleAxisd(vector.norm(), vector.normalized()));
  return {q.w(), q.x(), q.y(), q.z()};
}

}  // namespace

TEST_CASE(
    "reach: of a spherical joint the rotation vector to the target counts, whatever the "
    "quaternion's sign") {
  RobotDescription description = FloatingBody("hold");
  const Eigen::Quaterniond target(0.6, 0, 0.8, 0);
  description.task.target = {1, 2, 3, 0.6, 0, 0.8, 0, 0};
  const auto task = MakeTask(description);
  CHECK(task->observation_names() ==
        std::vector<std::string>{
            "e/free/x [m]", "e/free/y [m]", "e/free/z [m]", "e/free/rotation/x [rad]",
            "e/free/rotation/y [rad]", "e/free/rotation/z [rad]", "sin(e/wheel)", "cos(e/wheel)",
            "v/free/x [m/s]", "v/free/y [m/s]", "v/free/z [m/s]", "v/free/rotation/x [rad/s]",
            "v/free/rotation/y [rad/s]", "v/free/rotation/z [rad/s]", "v/wheel [rad/s]"});
  REQUIRE(task->observation_size() == 3 + 3 + 2 + 7);
  CHECK(task->action_indices() == std::vector<int>{6});
  CHECK(task->state_scale() ==
        (Eigen::VectorXd(14) << 1, 1, 1, 1, 1, 1, 1, 8, 8, 8, 8, 8, 8, 8).finished());

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
  // uniform on the sphere
  CHECK((moments - Eigen::Matrix4d::Identity() / 4).cwiseAbs().maxCoeff() < 0.01);

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
  CHECK_THROWS_WITH(MakeTask(description),
                    Catch::Contains("'slide'") && Catch::Contains("task.spread"));
  description.task.spread = {0.1, 0};
  CHECK_NOTHROW(MakeTask(description));
}

}  // namespace plumb
