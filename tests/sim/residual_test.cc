#include <catch2/catch.hpp>
#include <cmath>

#include "sim/environment.h"
#include "sim/residual_inputs.h"
#include "tests/sim/allocations.h"
#include "tests/sim/residuals.h"
#include "tests/sim/robots.h"

namespace plumb {
namespace {

Eigen::VectorXf RandomAction(const Environment& environment, Random& random) {
  Eigen::VectorXf action(environment.action_size());
  for (float& a : action) a = static_cast<float>(random.Uniform(-1, 1));
  return action;
}

}  // namespace

TEST_CASE("a residual of nothing changes nothing") {
  const RobotDescription robot = LoadRobot(SourceFile("robots/hopper/gym.toml"));
  Environment plain(robot), corrected(robot);
  const auto residual = Of(robot);
  residual->free = Constant(robot, Eigen::VectorXd::Zero(6));
  corrected.SetResidual(residual);
  Random a(1), b(1), c(2);
  b.Bits(), b.Bits();  // for the noise
  corrected.Reset(a), plain.Reset(b);
  for (int i = 0; i < 50; ++i) {
    const Eigen::VectorXf action = RandomAction(plain, c);
    CHECK(corrected.Step(action).reward == plain.Step(action).reward);
    CHECK(corrected.q() == plain.q());
    CHECK(corrected.v() == plain.v());
  }
}

TEST_CASE("a residual moves positions and velocities by what it says") {
  const RobotDescription robot = LoadPendulum("robot.toml");
  Environment plain(robot), corrected(robot);
  const auto residual = Of(robot);
  residual->free = Constant(robot, Eigen::Vector2d(0.25, 0.125));
  corrected.SetResidual(residual);
  for (Environment* environment : {&plain, &corrected})
    environment->SetState(Eigen::VectorXd::Constant(1, 1), Eigen::VectorXd::Constant(1, 0.5));
  const Eigen::VectorXf action = Eigen::VectorXf::Constant(1, 0.3f);
  plain.Step(action), corrected.Step(action);
  CHECK(corrected.v()[0] - plain.v()[0] == Approx(0.125).epsilon(1e-12));
  CHECK(corrected.q()[0] - plain.q()[0] == Approx(0.25).epsilon(1e-12));
  corrected.SetResidual(nullptr);
  for (Environment* environment : {&plain, &corrected})
    environment->SetState(Eigen::VectorXd::Constant(1, 1), Eigen::VectorXd::Constant(1, 0.5));
  plain.Step(action), corrected.Step(action);
  CHECK(corrected.v() == plain.v());
}

TEST_CASE("a residual turns a spherical joint about its link's axes, as its velocities do") {
  const RobotDescription robot = LoadRobot(SourceFile("robots/quadruped/robot.toml"));
  const ConfigurationSpace space(robot);
  Environment plain(robot), corrected(robot);
  const auto residual = Of(robot);
  Eigen::VectorXd change = Eigen::VectorXd::Zero(36);
  for (int i = 0; i < 36; ++i) change[i] = 0.03 * std::sin(1.0 + i);  // 18 of q, 18 of v
  residual->free = Constant(robot, change);
  corrected.SetResidual(residual);
  Random random(1);
  plain.Reset(random);
  Eigen::VectorXd q = plain.q(), v = plain.v();
  q[2] += 1;  // in the air
  q.segment<4>(3) << 0.5, -0.5, 0.5, 0.5;
  for (Environment* environment : {&plain, &corrected}) environment->SetState(q, v);
  const Eigen::VectorXf action = RandomAction(plain, random);
  plain.Step(action), corrected.Step(action);
  CHECK((space.Difference(corrected.q(), plain.q()) - change.head(18)).norm() < 1e-8);
  CHECK((corrected.v() - plain.v() - change.tail(18)).norm() < 1e-8);
  CHECK(space.Fault(corrected.q()).empty());
}

TEST_CASE("free and touching steps have residuals of their own") {
  const RobotDescription robot = LoadRobot(SourceFile("robots/hopper/gym.toml"));
  const auto residual = Of(robot);
  residual->touching = Constant(robot, Eigen::VectorXd::Constant(6, 0.25));
  Environment plain(robot), corrected(robot);
  corrected.SetResidual(residual);
  Eigen::VectorXd q = Eigen::VectorXd::Zero(6);
  const Eigen::VectorXf action = Eigen::VectorXf::Zero(3);
  q[3] = -0.5;  // away from its stop
  const auto change = [&](double height, double knee) {
    q[1] = height, q[4] = knee;
    for (Environment* environment : {&plain, &corrected})
      environment->SetState(q, Eigen::VectorXd::Zero(6));
    plain.Step(action), corrected.Step(action);
    return corrected.v()[0] - plain.v()[0];
  };
  CHECK(change(2, -1) == 0);                 // in the air
  CHECK(change(1.0, -0.1) == Approx(0.25));  // on the ground
  CHECK(change(2, -0.001) == Approx(0.25));  // at the knee's stop
  CHECK(change(2, -0.1) == 0);
}

TEST_CASE(
    "the inputs are observation, efforts of two steps, what constraints did, and what is near") {
  const RobotDescription robot = LoadRobot(SourceFile("robots/hopper/gym.toml"));
  const Model model(robot);
  Simulator simulator(robot);
  ResidualInputs inputs(model, 0.005);
  REQUIRE(inputs.size() == 11 + 3 + 3 + 6 + 2 * 3 + 5);
  Eigen::VectorXd q = Eigen::VectorXd::Zero(6), v = q, effort = q, before = q;
  q[1] = 2, q[3] = -0.5, q[4] = -1, v[3] = 0.5, effort[3] = 100, before[5] = -200;
  simulator.SetState(q, v);
  inputs.Begin(simulator);
  simulator.Step(effort, 0.0005);
  inputs.End(simulator, effort, before, 0.0005);
  CHECK(inputs.x()[0] == 2);                    // height
  CHECK(inputs.x()[8] == 0.5);                  // v of the thigh
  CHECK(inputs.x()[11] == Approx(100. / 200));  // in units of the limit
  CHECK(inputs.x()[16] == Approx(-1));
  const auto constrained = [&] { return inputs.x().segment(17, 6).cwiseAbs().maxCoeff(); };
  CHECK(constrained() < 1e-2);                    // nothing but a short step's error
  CHECK(inputs.x()[23] == StepContacts::kReach);  // the heel is far from the ground
  CHECK(inputs.x().segment(24, 2).isZero());
  CHECK(inputs.x().tail(5).isZero());  // and all joints from their stops
  CHECK_FALSE(inputs.touching());
  q[1] = 1.2, q[3] = q[4] = 0;  // deep in the ground
  simulator.SetState(q, v);
  inputs.Begin(simulator);
  simulator.Step(effort, 0.0005);
  inputs.End(simulator, effort, before, 0.0005);
  CHECK(constrained() > 0.05);
  CHECK(inputs.x()[23] < 0);
  CHECK(inputs.x()[25] != 0);                     // the thigh still turns
  CHECK(inputs.x()[31] == StepContacts::kReach);  // at its upper stop
  CHECK(inputs.touching());
}

TEST_CASE("a residual of another robot is refused") {
  const RobotDescription hopper = LoadRobot(SourceFile("robots/hopper/gym.toml")),
                         pendulum = LoadPendulum("robot.toml");
  const auto residual = Of(pendulum);
  residual->free = Constant(pendulum, Eigen::VectorXd::Constant(1, 0.125));
  Environment environment(hopper);
  CHECK_THROWS_WITH(environment.SetResidual(residual), Catch::Contains("another robot's"));
  Environment own(pendulum);
  CHECK_THROWS_WITH(own.SetResidual(residual, 1), Catch::Contains("no such draw"));
}

TEST_CASE("an episode that its residual blows up ends, with a return that is none") {
  const RobotDescription robot = LoadRobot(SourceFile("robots/hopper/gym.toml"));
  const auto residual = Of(robot);
  residual->free = residual->touching = Constant(robot, Eigen::VectorXd::Constant(6, 1e7));
  residual->free->bound.setConstant(1e7), residual->touching->bound.setConstant(1e7);
  Environment environment(robot);
  environment.SetResidual(residual);
  Random random(1);
  environment.Reset(random);
  const StepResult result = environment.Step(Eigen::VectorXf::Zero(3));
  CHECK(result.terminated);
  CHECK(std::isnan(result.reward));
  environment.SetResidual(nullptr);
  environment.Reset(random);
  CHECK_FALSE(environment.Step(Eigen::VectorXf::Zero(3)).terminated);
}

TEST_CASE("steps with a residual do not allocate") {
  const RobotDescription robot = LoadRobot(SourceFile("robots/hopper/gym.toml"));
  Environment environment(robot);
  const auto residual = Of(robot);
  residual->free = Constant(robot, Eigen::VectorXd::Zero(6));
  residual->touching = residual->free;
  environment.SetResidual(residual);
  Random random(1);
  environment.Reset(random);
  const Eigen::VectorXf action = Eigen::VectorXf::Constant(3, 0.1f);
  environment.Step(action);
  const auto before = Allocations();
  for (int i = 0; i < 20; ++i) environment.Step(action);
  CHECK(Allocations() == before);
}

}  // namespace plumb
