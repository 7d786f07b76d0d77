#include "sim/environment.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <utility>

#include "tests/sim/allocations.h"
#include "tests/sim/robots.h"
#include "tests/sim/scalar.h"

namespace plumb {
namespace {

using Eigen::VectorXd;
using Eigen::VectorXf;

VectorXf Action(float x) { return VectorXf::Constant(1, x); }

}  // namespace

TEST_CASE("an episode of gym.toml is gym's") {
  Environment environment(LoadPendulum("gym.toml"));
  CHECK(environment.steps_per_episode() == 200);
  CHECK(environment.observation_size() == 3);
  CHECK(environment.action_size() == 1);
  CHECK(environment.parameter_count() == 3);
  environment.SetParameters(Eigen::Vector3d(10, 1, 1));
  double q = 3, v = -0.5;
  environment.SetState(Scalar(q), Scalar(v));
  Random random(2);
  for (int i = 0; i < 60; ++i) {
    const auto action = static_cast<float>(random.Uniform(-1.5, 1.5));
    const double u = 2 * std::clamp(static_cast<double>(action), -1.0, 1.0);
    const double angle = std::remainder(q, 2 * M_PI);
    const double reward = -(angle * angle + 0.1 * v * v + 0.001 * u * u);
    v = std::clamp(v + 0.05 * (15 * std::sin(q) + 3 * u), -8.0, 8.0);
    q += 0.05 * v;
    const StepResult result = environment.Step(Action(action));
    CHECK(result.reward == Approx(reward).epsilon(1e-9));
    CHECK_FALSE(result.terminated);
    REQUIRE(std::abs(environment.q()[0] - q) < 1e-9);
  }
  VectorXf observation(3);
  environment.Observe(observation);
  CHECK(observation[0] == Approx(std::cos(q)).epsilon(1e-6));
  CHECK(observation[2] == Approx(v).epsilon(1e-6));
}

TEST_CASE("with latency the previous action acts first") {
  RobotDescription description = LoadPendulum("robot.toml");
  description.simulation.latency = 0.02;
  Environment environment(description);
  Simulator simulator(description);
  environment.SetState(Scalar(1), Scalar(0));
  simulator.SetState(Scalar(1), Scalar(0));
  environment.Step(Action(1));  // nothing came before
  environment.Step(Action(-0.5f));
  simulator.Step(Scalar(0), 0.02);
  simulator.Step(Scalar(2), 0.03);
  simulator.Step(Scalar(2), 0.02);
  simulator.Step(Scalar(-1), 0.03);
  CHECK(environment.q()[0] == Approx(simulator.q()[0]).epsilon(1e-13));
  CHECK(environment.v()[0] == Approx(simulator.v()[0]).epsilon(1e-13));

  // A new state forgets the action before it.
  environment.SetState(Scalar(1), Scalar(0));
  environment.Step(Action(0));
  Environment fresh(description);
  fresh.SetState(Scalar(1), Scalar(0));
  fresh.Step(Action(0));
  CHECK(environment.v() == fresh.v());
}

TEST_CASE("a step without a driver has the bits of the recorded one, wherever its effort changes") {
  const RobotDescription robot = LoadRobot(SourceFile("robots/double_pendulum/robot.toml"));
  const double latency = robot.simulation.latency, period = robot.task.period;
  REQUIRE(std::remainder(latency, robot.simulation.substep) != 0);
  Environment environment(robot);
  Simulator simulator(robot);
  VectorXd q(2), v(2), before = VectorXd::Zero(2);
  q << 0.5, -1, v << 1, 2;
  environment.SetState(q, v);
  simulator.SetState(q, v);
  for (const float a : {0.5f, -1.0f, 0.25f}) {
    environment.Step(VectorXf::Constant(environment.action_size(), a));
    const VectorXd effort = environment.effort();
    simulator.Step(std::vector<EffortSegment>{{latency, before}, {period - latency, effort}});
    CHECK(environment.q() == simulator.q());
    CHECK(environment.v() == simulator.v());
    before = effort;
  }
}

TEST_CASE("resets are the generator's alone") {
  Environment one(LoadPendulum("robot.toml")), other(LoadPendulum("robot.toml"));
  other.Step(Action(1));
  Random a(9, {1, 2}), b(9, {1, 2});
  one.Reset(a);
  other.Reset(b);
  CHECK(one.q() == other.q());
  one.Step(Action(0.3f));
  other.Step(Action(0.3f));
  CHECK(one.v() == other.v());
}

TEST_CASE("an episode that blows up terminates") {
  RobotDescription description = LoadPendulum("robot.toml");
  Environment environment(description);
  const double most = std::numeric_limits<double>::max();
  environment.SetState(Scalar(most), Scalar(most));
  CHECK(environment.Step(Action(0)).terminated);
  environment.SetState(Scalar(0), Scalar(0));
  CHECK_FALSE(environment.Step(Action(0)).terminated);
}

TEST_CASE("environment steps do not allocate") {
  Environment environment(LoadPendulum("robot.toml"));
  const VectorXf action = Action(0.5f);
  VectorXf observation(3);
  Random random(1);
  const Eigen::VectorXd physical = Eigen::Vector3d(10, 1, 1);
  const int64_t before = Allocations();
  environment.SetParameters(physical);
  environment.Reset(random);
  environment.Step(action);
  environment.Observe(observation);
  CHECK(Allocations() == before);
}

TEST_CASE("through a driver efforts against a stop do nothing, and those away from it act") {
  const RobotDescription robot = LoadRobot(SourceFile("robots/hopper/robot.toml"));
  Environment environment(robot), driven(robot);
  driven.SendThroughDriver();
  VectorXd q = VectorXd::Zero(6);
  q[1] = 3, q[3] = -1, q[4] = 0.001;  // in the air; the knee is stretched as far as it goes
  const auto after = [&](Environment& one, float knee) {
    one.SetState(q, VectorXd::Zero(6));
    one.Step(Eigen::Vector3f(0.2f, knee, 0));
    return std::pair(one.q(), one.v());
  };
  CHECK(after(driven, 1) == after(environment, 0));
  CHECK(after(driven, 1) != after(environment, 1));
  CHECK(after(driven, -0.5f) == after(environment, -0.5f));
}

TEST_CASE("through a driver a quadruped's knee at its stop is not pushed into it") {
  RobotDescription robot = LoadRobot(SourceFile("robots/quadruped"));
  // Through a driver substeps are others, by which the bounce off a stop is another.
  robot.simulation.integrator = SimulationSettings::Integrator::kSemiImplicit;
  robot.simulation.substep = 0.004;
  Environment environment(robot), driven(robot);
  driven.SendThroughDriver();
  const auto& joints = robot.joints;
  const auto knee =
      static_cast<size_t>(std::find_if(joints.begin(), joints.end(),
                                       [](const auto& j) { return j.name == "rear_left_knee"; }) -
                          joints.begin());
  VectorXd q = VectorXd::Zero(19);
  q[2] = 2, q[3] = 1;  // in the air
  for (size_t i = 4; i < joints.size(); ++i)
    q[static_cast<Eigen::Index>(i) + 3] = joints[i].dynamics.rest;
  q[static_cast<Eigen::Index>(knee) + 3] = joints[knee].upper + 0.001;
  const auto after = [&](Environment& one, float action) {
    Eigen::VectorXf actions = Eigen::VectorXf::Zero(12);
    actions[static_cast<Eigen::Index>(knee) - 4] = action;
    one.SetState(q, VectorXd::Zero(18));
    for (int step = 0; step < 5; ++step) one.Step(actions);
    return one.q()[static_cast<Eigen::Index>(knee) + 3];
  };
  // 32 Nm: more than the spring of its drive, which would bring it back.
  const double pushed = after(environment, 0.9f), limited = after(driven, 0.9f),
               free = after(environment, 0);
  CHECK(pushed > joints[knee].upper + 0.001);
  CHECK(limited < pushed - 0.01);
  CHECK(limited > free);
  CHECK(after(driven, -0.3f) == Approx(after(environment, -0.3f)).margin(0.02));  // other substeps
}

TEST_CASE("a driver looks at a joint in each of its cycles") {
  const RobotDescription robot = LoadRobot(SourceFile("robots/hopper/robot.toml"));
  Environment driven(robot);
  driven.SendThroughDriver();
  Simulator simulator(robot);
  VectorXd q = VectorXd::Zero(6), v = q, effort = q;
  q[1] = 3, q[3] = -1, q[4] = -0.01, v[4] = 2;  // 5 ms from its stop
  driven.SetState(q, v);
  driven.Step(Eigen::Vector3f(0, 1, 0));
  simulator.SetState(q, v);
  simulator.Step(effort, robot.simulation.latency);
  effort[4] = 200;
  int cut = 0;
  for (int cycle = 0; cycle < 3; ++cycle) {  // the rest of the period of 8 ms
    if (simulator.q()[4] > 0) effort[4] = 0, ++cut;
    simulator.Step(effort, robot.driver.cycle);
  }
  CHECK((cut > 0 && cut < 3));
  CHECK((driven.q() - simulator.q()).norm() < 1e-12);
}

}  // namespace plumb
