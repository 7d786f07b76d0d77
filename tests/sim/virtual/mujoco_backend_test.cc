#include "sim/virtual/mujoco_backend.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "sim/simulator.h"
#include "sim/virtual/simbody_plant.h"
#include "sim/virtual/virtual_plant.h"
#include "tests/sim/mujoco_hopper.h"
#include "tests/sim/virtual/advance.h"
#include "tests/sim/virtual/ball.h"

namespace plumb {
namespace {

using Eigen::Vector2d;
using Eigen::VectorXd;

}  // namespace

TEST_CASE("mujoco's engine: a tree in space moves as Simbody's") {
  RobotDescription tree = MakeTree();
  for (JointDescription& joint : tree.joints) joint.dynamics.damping = 0.1;
  tree.joints[2].dynamics.stiffness = 3, tree.joints[2].dynamics.rest = 0.4,
  tree.joints[1].dynamics.motor_gain = 0.8;
  REQUIRE(SimbodyPlant::Lacks(tree).empty());
  const auto engine = MakeMujocoBackend(tree);
  SimbodyPlant plant(tree, 1e-3);
  const VectorXd q = Eigen::Vector4d(0.1, -0.5, 0.7, 1.2), v = Eigen::Vector4d(0.3, 1, -1, 2),
                 effort = Eigen::Vector4d(5, 1, -0.5, 0.3);
  engine->SetState(q, v);
  plant.SetState(q, v);
  REQUIRE(Advance(*engine, effort, 0.5));
  REQUIRE(plant.Advance(effort, 0.5));
  CHECK((plant.q() - q).norm() > 0.5);  // it has moved
  CHECK((engine->q() - plant.q()).norm() < 1e-6);
  CHECK((engine->v() - plant.v()).norm() < 1e-5);
}

TEST_CASE("mujoco's engine: a hopper in flight moves as the simulator's, whatever the steps") {
  // Away from the limits, which are others.
  const RobotDescription hopper = Known("hopper");
  const auto engine = MakeMujocoBackend(hopper);
  RobotDescription fine = hopper;
  fine.simulation.substep = 1e-5;
  Simulator simulator(fine);
  VectorXd q(6), v(6), effort(6);
  q << 0.3, 9, 0.1, -1.2, -1.2, 0.1;
  v << 1, 2, -0.5, 1, -1, 0.5;
  effort << 0, 0, 0, 10, -10, 2;
  engine->SetState(q, v);
  simulator.SetState(q, v);
  REQUIRE(Advance(*engine, effort, 0.3));
  simulator.Step(effort, 0.3);
  CHECK((engine->q() - simulator.q()).norm() < 1e-6);
  CHECK((engine->v() - simulator.v()).norm() < 1e-5);
}

TEST_CASE("mujoco's engine: on the ground and at its stops the hopper is gym's, step by step") {
  // As published but for the masses, which are ours; its own limbs do not meet here.
  const auto engine = MakeMujocoBackend(Known("hopper"));
  MujocoHopper theirs;
  const RobotDescription hopper = Known("hopper");
  theirs.SetMasses(
      {hopper.links[3].mass, hopper.links[4].mass, hopper.links[5].mass, hopper.links[6].mass});
  VectorXd q(6);
  q << 0, 1.25, 0, 0, 0, 0;
  theirs.SetState(q, 0 * q);
  engine->SetState(q, 0 * q);
  int touched = 0, step = 0;
  for (; theirs.q()[1] > 0.9; ++step) {  // until it lies down
    const double phase = 0.05 * step;
    const Eigen::Vector3d action(0.3 * std::sin(phase), 0.2 * std::sin(2 * phase),
                                 0.1 * std::sin(3 * phase));
    VectorXd effort = VectorXd::Zero(6);
    effort.tail<3>() = 200 * action;
    theirs.Step(action);
    REQUIRE(engine->Advance(effort, MujocoHopper::kTimeStep));
    touched += theirs.contacts() > 0;
    REQUIRE((engine->q() - theirs.q()).norm() < 1e-6);
  }
  INFO(step << " steps");
  CHECK(step > 100);
  CHECK(touched > 50);
}

TEST_CASE("mujoco's engine: the ground bears what rests on it, and holds it by its friction") {
  const auto engine = MakeMujocoBackend(Ball());
  const double weight = 2 * 9.81;
  engine->SetState(Vector2d(0, 0.101), Vector2d::Zero());
  REQUIRE(Advance(*engine, Vector2d(0, 0), 2));
  const double height = engine->q()[1];
  CHECK(std::abs(height - 0.1) < 2e-3);
  REQUIRE(Advance(*engine, Vector2d(0, 0), 1));
  CHECK(engine->q()[1] == Approx(height).margin(1e-6));
  CHECK(engine->v().norm() < 1e-6);
  // Nothing is borne of what hangs: then it does not lean on the ground.
  REQUIRE(Advance(*engine, Vector2d(0, 1.1 * weight), 0.5));
  CHECK(engine->q()[1] == Approx(height + 0.5 * 0.1 * 9.81 * 0.25).epsilon(0.03));

  const auto slid = [&](double push) {
    engine->SetState(Vector2d(0, height), Vector2d::Zero());
    REQUIRE(Advance(*engine, Vector2d(push, 0), 1));
    return engine->q()[0];
  };
  CHECK(slid(0.3 * weight) < 0.02);  // it creeps, being soft
  CHECK(slid(0.9 * weight) == Approx(0.5 * 0.4 * 9.81).epsilon(0.05));
}

TEST_CASE("mujoco's engine: friction, stops and numbers that are none") {
  RobotDescription pendulum = Known("pendulum");
  pendulum.simulation.gravity = 0;
  pendulum.joints[0].dynamics.friction = 0.5;
  const double inertia = 0.25 * pendulum.links[1].mass + pendulum.links[1].inertia(1, 1);
  const auto engine = MakeMujocoBackend(pendulum);
  engine->SetState(VectorXd::Zero(1), VectorXd::Constant(1, 3));
  REQUIRE(Advance(*engine, VectorXd::Zero(1), 5));
  CHECK(std::abs(engine->v()[0]) < 0.01);
  CHECK(engine->q()[0] == Approx(inertia * 9 / 2 / 0.5).epsilon(0.1));  // at the end it is viscous

  const VectorXd one = VectorXd::Ones(1);
  engine->SetState(one, one);
  CHECK_FALSE(engine->Advance(one * std::numeric_limits<double>::quiet_NaN(), 0.01));
  CHECK_FALSE(engine->Advance(one * 1e308, 1));
  CHECK(engine->q() == one);
  CHECK(engine->v() == one);
  CHECK(engine->Advance(one, 0.01));
  CHECK_THROWS_AS(engine->SetState(one * std::numeric_limits<double>::infinity(), one),
                  std::invalid_argument);
  CHECK_THROWS_AS(engine->SetState(VectorXd::Ones(2), one), std::invalid_argument);
}

TEST_CASE(
    "mujoco's engine: a robot that it cannot be told is refused, with the line that asks for it") {
  RobotDescription hopper = Known("hopper");
  hopper.virtual_robot.engine = VirtualRobotSettings::Engine::kMujoco;
  hopper.virtual_robot.engine_source = "robot.toml:7:1: ";
  CHECK_NOTHROW(VirtualPlant(hopper));
  hopper.joints[4].dynamics.delay = 0.01;
  CHECK_THROWS_WITH(
      VirtualPlant(hopper),
      Catch::Equals("robot.toml:7:1: virtual_robot.engine = \"mujoco\" is not possible: "
                    "delays and sensor errors of joint 'leg'"));
  hopper.joints[4].dynamics.delay = 0;
  hopper.links[6].inertia *= -1;
  CHECK_THROWS_WITH(VirtualPlant(hopper), Catch::Contains("MuJoCo refuses the robot"));
}

}  // namespace plumb
