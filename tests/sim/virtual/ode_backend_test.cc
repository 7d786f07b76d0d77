#include "sim/virtual/ode_backend.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numbers>

#include "sim/simulator.h"
#include "sim/virtual/simbody_plant.h"
#include "sim/virtual/sprung_masses.h"
#include "sim/virtual/virtual_plant.h"
#include "tests/sim/trees.h"
#include "tests/sim/virtual/ball.h"
#include "tests/sim/virtual/sprung_carrier.h"

namespace plumb {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;
using Engine = VirtualRobotSettings::Engine;

/// By steps that have nothing in common with any period, or shorter ones.
bool Advance(PhysicsBackend& engine, const VectorXd& effort, double duration,
             double step = 0.0037) {
  for (double t = 0; t < duration; t += step) {
    if (!engine.Advance(effort, std::min(step, duration - t))) return false;
  }
  return true;
}

/// How far it ends from where another engine does, of positions and of velocities.
struct Distance {
  Distance(const RobotDescription& robot, const VectorXd& q, const VectorXd& v,
           const VectorXd& effort, double duration, double step, const VectorXd& true_q,
           const VectorXd& true_v) {
    const auto engine = MakeOdeBackend(robot);
    engine->SetState(q, v);
    REQUIRE(Advance(*engine, effort, duration, step));
    positions = (engine->q() - true_q).norm();
    velocities = (engine->v() - true_v).norm();
  }
  double positions, velocities;
};

VectorXd Numbers(std::initializer_list<double> numbers) {
  return Eigen::Map<const VectorXd>(numbers.begin(), static_cast<Eigen::Index>(numbers.size()));
}

/// The ball on a ground of its own, moved by ODE.
VirtualPlant BallOn(const UnmodelledGround& ground) {
  RobotDescription ball = Ball();
  ball.virtual_robot.engine = Engine::kOde;
  ball.virtual_robot.ground = ground;
  return VirtualPlant(ball);
}

Vector2d After(VirtualPlant plant, const Vector2d& q, const Vector2d& v, double duration) {
  plant.SetState(q, v);
  for (double t = 0; t < duration; t += 0.0037)
    REQUIRE(plant.Advance(Vector2d::Zero(), std::min(0.0037, duration - t)));
  return plant.q();
}

UnmodelledGround Slope(double slope) {
  UnmodelledGround ground;
  ground.slope = slope;
  return ground;
}

TEST_CASE("ode's engine: where nothing touches, robots move as the simulator's") {
  // It is of first order: what remains goes with the step.
  struct Case {
    const char* robot;
    VectorXd q, v, effort;
    double duration, positions, velocities;
  };
  const Case cases[] = {
      {"hopper", Numbers({0.3, 9, 0.1, -1.2, -1.2, 0.1}), Numbers({1, 2, -0.5, 1, -1, 0.5}),
       Numbers({0, 0, 0, 10, -10, 2}), 0.3, 1e-3, 1e-3},
      {"pendulum", Numbers({0.5}), Numbers({4}), Numbers({0.7}), 2, 2e-3, 1e-2},
      {"cartpole", Numbers({0.1, 0.4}), Numbers({-0.3, 2}), Numbers({1, 0}), 0.5, 2e-3, 1e-2},
      {"double_pendulum", Numbers({0.4, -0.8}), Numbers({1, 2}), Numbers({1, -0.5}), 0.5, 2e-3,
       1e-2},
  };
  for (const Case& c : cases) {
    RobotDescription robot = Known(c.robot);
    // Where it is slow, the simulator's gives way.
    for (JointDescription& joint : robot.joints) joint.dynamics.friction = 0;
    robot.simulation.integrator = SimulationSettings::Integrator::kLeapfrog;
    robot.simulation.substep = 1e-5;
    Simulator simulator(robot);
    simulator.SetState(c.q, c.v);
    simulator.Step(c.effort, c.duration);
    const auto distance = [&](double step) {
      return Distance(robot, c.q, c.v, c.effort, c.duration, step, simulator.q(), simulator.v());
    };
    INFO(c.robot);
    const Distance usual = distance(0.0037), fine = distance(kOdeStep / 10);
    CHECK(usual.positions < c.positions);
    CHECK(usual.velocities < c.velocities);
    CHECK(fine.positions < 0.13 * usual.positions);
    CHECK(fine.velocities < 0.13 * usual.velocities);
    CHECK((simulator.q() - c.q).norm() > 0.1);
  }
}

TEST_CASE("ode's engine: a tree in space moves as Simbody's") {
  RobotDescription tree = MakeTree();
  for (JointDescription& joint : tree.joints) joint.dynamics.damping = 0.1;
  tree.joints[2].dynamics.stiffness = 3, tree.joints[2].dynamics.rest = 0.4,
  tree.joints[1].dynamics.motor_gain = 0.8;
  SimbodyPlant plant(tree, 1e-3);
  const VectorXd q = Numbers({0.1, -0.5, 0.7, 1.2}), v = Numbers({0.3, 1, -1, 2}),
                 effort = Numbers({5, 1, -0.5, 0.3});
  plant.SetState(q, v);
  REQUIRE(plant.Advance(effort, 0.5));
  const auto distance = [&](double step) {
    return Distance(tree, q, v, effort, 0.5, step, plant.q(), plant.v());
  };
  const Distance usual = distance(0.0037), fine = distance(kOdeStep / 10);
  CHECK(usual.positions < 2e-3);
  CHECK(usual.velocities < 2e-2);
  CHECK(fine.positions < 0.12 * usual.positions);
  CHECK(fine.velocities < 0.12 * usual.velocities);
}

TEST_CASE("ode's engine: a double pendulum that nothing brakes keeps its energy") {
  const RobotDescription robot = Frictionless(Known("double_pendulum"));
  const auto engine = MakeOdeBackend(robot);
  Simulator simulator(robot);
  const auto energy = [&] {
    simulator.SetState(engine->q(), engine->v());
    return 0.5 * engine->v().dot(simulator.MassMatrix() * engine->v()) +
           PotentialEnergy(robot, engine->q());
  };
  const auto lost = [&](double step) {
    engine->SetState(Vector2d(2, 1), Vector2d(0, 3));
    const double before = energy();
    double most = 0;
    for (int i = 0; i < 20; ++i) {
      REQUIRE(Advance(*engine, Vector2d(0, 0), 0.1, step));
      most = std::max(most, std::abs(energy() - before));
    }
    return most;
  };
  engine->SetState(Vector2d(2, 1), Vector2d(0, 3));
  const double scale = energy() - PotentialEnergy(robot, VectorXd::Zero(2));
  const double usual = lost(0.0037);
  CHECK(usual < 0.01 * std::abs(scale));
  CHECK(lost(kOdeStep / 10) < 0.2 * usual);
}

TEST_CASE("ode's engine: the ground bears what rests on it, and holds it by its friction") {
  const auto engine = MakeOdeBackend(Ball());
  const double weight = 2 * 9.81;
  engine->SetState(Vector2d(0, 0.101), Vector2d::Zero());
  REQUIRE(Advance(*engine, Vector2d(0, 0), 2));
  const double height = engine->q()[1];
  CHECK(0.1 - height == Approx(weight / kOdeGround.stiffness).epsilon(1e-6));
  CHECK(engine->v().norm() < 1e-9);
  // Nothing is borne of what hangs, and nothing holds it down; the ground has pushed it a little.
  REQUIRE(Advance(*engine, Vector2d(0, 1.1 * weight), 0.5));
  CHECK(engine->q()[1] == Approx(height + 0.5 * 0.1 * 9.81 * 0.25).epsilon(0.02));

  const auto slid = [&](double push) {
    engine->SetState(Vector2d(0, height), Vector2d::Zero());
    REQUIRE(Advance(*engine, Vector2d(push * weight, 0), 1));
    return engine->q()[0];
  };
  CHECK(std::abs(slid(0.49)) < 1e-6);  // it does not creep
  CHECK(slid(0.55) == Approx(0.5 * 0.05 * 9.81).epsilon(0.01));
  CHECK(slid(-0.9) == Approx(-0.5 * 0.4 * 9.81).epsilon(0.01));
}

TEST_CASE("ode's engine: a ground that no model knows") {
  UnmodelledGround stiff, slippery;
  stiff.stiffness_factor = 5;
  slippery.friction = 0.25;
  const Vector2d none(0, 0);
  CHECK(0.1 - After(BallOn(stiff), {0, 0.1}, none, 2)[1] ==
        Approx(2 * 9.81 / (5 * kOdeGround.stiffness)).epsilon(1e-6));
  CHECK(After(BallOn(slippery), {0, 0.0999}, {2, 0}, 1)[0] ==
        Approx(4 / (2 * 0.25 * 9.81)).epsilon(0.01));
  const double slope = 0.6;
  const Vector2d fallen = After(BallOn(Slope(slope)), {0, 10}, none, 0.5);
  CHECK(fallen[0] == Approx(-0.125 * 9.81 * std::sin(slope)).epsilon(1e-3));
  CHECK(fallen[1] == Approx(10 - 0.125 * 9.81 * std::cos(slope)).epsilon(1e-3));
  // A friction of 0.5 holds up to 0.46 rad; beyond, it slides down.
  CHECK(std::abs(After(BallOn(Slope(0.45)), {0, 0.0999}, none, 1)[0]) < 1e-4);
  CHECK(After(BallOn(Slope(slope)), {0, 0.0999}, none, 1)[0] ==
        Approx(-0.5 * 9.81 * (std::sin(slope) - 0.5 * std::cos(slope))).epsilon(0.01));
}

TEST_CASE("ode's engine: a box rests on its corners, and a ball that bounces loses energy") {
  RobotDescription box = Ball();
  Shape& shape = box.links[2].collisions[0];
  shape.type = Shape::Type::kBox;
  shape.size = {0.4, 0.3, 0.2};
  const auto engine = MakeOdeBackend(box);
  engine->SetState(Vector2d(0, 0.11), Vector2d::Zero());
  REQUIRE(Advance(*engine, Vector2d(0, 0), 2));
  CHECK(0.1 - engine->q()[1] == Approx(2 * 9.81 / (4 * kOdeGround.stiffness)).epsilon(1e-6));

  const auto ball = MakeOdeBackend(Ball());
  ball->SetState(Vector2d(0, 0.6), Vector2d(0, 0));
  REQUIRE(Advance(*ball, Vector2d(0, 0), 0.4));  // it falls for 0.32 s
  double highest = 0;
  for (int i = 0; i < 500; ++i) {
    REQUIRE(ball->Advance(Vector2d(0, 0), 1e-3));
    highest = std::max(highest, ball->q()[1]);
  }
  CHECK(highest < 0.5);
}

TEST_CASE("ode's engine: a stop gives way as its stiffness says") {
  RobotDescription hopper = Known("hopper");
  hopper.simulation.gravity = 0;
  // The foot alone: it is pushed beyond its limit, and nothing else can move.
  for (size_t i = 0; i < 5; ++i) hopper.joints[i].dynamics.armature = 1e9;
  const auto engine = MakeOdeBackend(hopper);
  VectorXd q = VectorXd::Zero(6), effort = VectorXd::Zero(6);
  q[1] = 9;
  effort[5] = 100;
  engine->SetState(q, 0 * q);
  REQUIRE(Advance(*engine, effort, 1.5));
  CHECK(engine->q()[5] - hopper.joints[5].upper == Approx(100 / kOdeStop.stiffness).epsilon(1e-3));
  CHECK(std::abs(engine->v()[5]) < 1e-6);
  REQUIRE(Advance(*engine, -effort, 1.5));
  CHECK(engine->q()[5] - hopper.joints[5].lower == Approx(-100 / kOdeStop.stiffness).epsilon(1e-3));
}

TEST_CASE("ode's engine: friction in a joint holds, and stops what moves") {
  RobotDescription pendulum = Known("pendulum");
  pendulum.simulation.gravity = 0;
  pendulum.joints[0].dynamics.friction = 0.5;
  const double inertia = Simulator(pendulum).MassMatrix()(0, 0);
  const auto engine = MakeOdeBackend(pendulum);
  // More than once around.
  engine->SetState(VectorXd::Zero(1), VectorXd::Constant(1, 9));
  REQUIRE(Advance(*engine, VectorXd::Zero(1), 10));
  const double end = inertia * 81 / 2 / 0.5;
  REQUIRE(end > 2 * std::numbers::pi);
  CHECK(engine->q()[0] == Approx(end).epsilon(1e-3));
  CHECK(std::abs(engine->v()[0]) < 1e-9);
  REQUIRE(Advance(*engine, VectorXd::Constant(1, 0.49), 1));
  CHECK(std::abs(engine->v()[0]) < 1e-6);
  REQUIRE(Advance(*engine, VectorXd::Constant(1, 0.6), 0.1));
  CHECK(engine->v()[0] == Approx(0.1 * 0.1 / inertia).epsilon(1e-3));
}

TEST_CASE("ode's engine: a sprung mass swings against the link that carries it") {
  constexpr double kForce = 10 * SprungCarrier::kBoth;
  RobotDescription carrier = SprungCarrier::Robot(Engine::kOde);
  carrier.simulation.gravity = 0;
  VirtualPlant plant(carrier);
  plant.SetState(Vector2d(0, 3), Vector2d::Zero());
  for (int i = 1; i <= 60; ++i) {
    REQUIRE(plant.Advance(Vector2d(0, kForce), 0.005));
    // ODE is of first order
    REQUIRE(plant.q()[1] == Approx(3 + SprungCarrier::Rise(kForce, 0.005 * i)).margin(1e-3));
    REQUIRE(std::abs(plant.q()[0]) < 1e-9);
  }
}

TEST_CASE("ode's engine: a slide on a link that turns has the simulator's speed") {
  // A mass that swings askew on the second pendulum, which goes round: it feels that it turns.
  RobotDescription robot = Known("double_pendulum");
  robot.virtual_robot.sprung_masses = {{.name = "load",
                                        .link = 2,
                                        .mass = 0.2,
                                        .frequency = 3,
                                        .damping_ratio = 0.2,
                                        .axis = Vector3d(1, 2, 2) / 3,
                                        .centre = {0.1, 0.1, 0.2},
                                        .travel = std::numeric_limits<double>::infinity()}};
  std::vector<VectorXd> ends;
  for (const Engine engine : {Engine::kAuto, Engine::kOde}) {
    robot.virtual_robot.engine = engine;
    VirtualPlant plant(robot);
    plant.SetState(Vector2d(0.4, -0.8), Vector2d(2, 8));
    for (int i = 0; i < 100; ++i) REQUIRE(plant.Advance(Vector2d(1, 0.5), 0.005));
    ends.push_back(plant.q());
  }
  CHECK((ends[0] - Vector2d(0.4, -0.8)).norm() > 0.5);
  CHECK((ends[1] - ends[0]).norm() < 5e-3);
  // Its own speed, as the joint has it.
  const auto engine = MakeOdeBackend(WithSprungMasses(robot));
  engine->SetState(Vector3d(0.4, -0.8, 0.01), Vector3d(2, 8, 0.5));
  REQUIRE(engine->Advance(VectorXd::Zero(3), 1e-7));
  CHECK((engine->v() - Vector3d(2, 8, 0.5)).norm() < 1e-3);
}

TEST_CASE("ode's engine: the same calls give the same bits, however short the steps between") {
  const RobotDescription hopper = Known("hopper");
  const auto engine = MakeOdeBackend(hopper), again = MakeOdeBackend(hopper);
  VectorXd q = VectorXd::Zero(6), effort = VectorXd::Zero(6);
  q[1] = 1.25;  // it stands
  effort.tail<3>() << -20, -30, 10;
  again->SetState(q, 0 * q);
  REQUIRE(Advance(*again, -effort, 0.2));  // whatever was before
  engine->SetState(q, 0 * q);
  again->SetState(q, 0 * q);
  for (int i = 0; i < 300; ++i) {
    const double duration = i % 3 == 0 ? 1e-6 : i % 3 == 1 ? 1.3e-4 : 0.0021;
    REQUIRE(engine->Advance(effort, duration));
    REQUIRE(again->Advance(effort, duration));
  }
  CHECK(engine->q() == again->q());
  CHECK(engine->v() == again->v());
  CHECK(engine->q()[1] > 1.25 - 0.15);  // in flight it would have fallen by 0.24 m
  const auto even = MakeOdeBackend(hopper);
  even->SetState(q, 0 * q);
  REQUIRE(Advance(*even, effort, 100 * (1e-6 + 1.3e-4 + 0.0021), 1e-4));
  CHECK((engine->q() - even->q()).norm() < 5e-3);
}

TEST_CASE("ode's engine: numbers that are none, and what it cannot be told") {
  const auto engine = MakeOdeBackend(Ball());
  const Vector2d q(0, 0.5), v(1, 2);
  engine->SetState(q, v);
  CHECK_FALSE(engine->Advance(q * std::numeric_limits<double>::quiet_NaN(), 0.01));
  CHECK_FALSE(engine->Advance(Vector2d(1e308, 1e308), 1));
  CHECK_FALSE(engine->Advance(Vector2d(9e8, 9e8), 10));  // not at once
  CHECK(engine->q() == q);
  CHECK(engine->v() == v);
  CHECK(engine->Advance(Vector2d(0, 0), 0.01));
  engine->SetState(q, Vector2d(1e308, 0));
  CHECK_FALSE(engine->Advance(Vector2d(0, 0), 0.01));
  CHECK_THROWS_AS(engine->SetState(q * std::numeric_limits<double>::infinity(), v),
                  std::invalid_argument);
  CHECK_THROWS_AS(engine->SetState(VectorXd::Ones(3), v), std::invalid_argument);

  RobotDescription hopper = Known("hopper");
  hopper.virtual_robot.engine = Engine::kOde;
  hopper.virtual_robot.engine_source = "robot.toml:7:1: ";
  CHECK_NOTHROW(VirtualPlant(hopper));
  const auto refused = [&](const std::string& why) {
    CHECK_THROWS_WITH(VirtualPlant(hopper),
                      Catch::Equals("robot.toml:7:1: virtual_robot.engine = \"ode\" is not "
                                    "possible: " +
                                    why));
  };
  hopper.joints[4].dynamics.delay = 0.01;
  refused("delays and sensor errors of joint 'leg'");
  hopper.joints[4].dynamics.delay = 0;
  hopper.joints[3].upper = 4;
  refused("the stops beyond half a turn of joint 'thigh'");
  hopper.joints[3].upper = 0;
  hopper.links[6].inertia *= -1;
  refused("the inertia of link 'foot'");
}

}  // namespace
}  // namespace plumb
