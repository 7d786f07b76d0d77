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
#include "tests/sim/virtual/advance.h"
#include "tests/sim/virtual/ball.h"
#include "tests/sim/virtual/sprung_carrier.h"

namespace plumb {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;
using PlantEngine = VirtualRobotSettings::Engine;

/// How far it ends from where another engine does, of positions and of velocities.
struct BackendDistance {
  BackendDistance(const RobotDescription& robot, const VectorXd& q, const VectorXd& v,
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
      return BackendDistance(robot, c.q, c.v, c.effort, c.duration, step, simulator.q(),
                             simulator.v());
    };
    INFO(c.robot);
    const BackendDistance usual = distance(0.0037), fine = distance(kOdeStep / 10);
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
    return BackendDistance(tree, q, v, effort, 0.5, step, plant.q(), plant.v());
  };
  const BackendDistance usual = distance(0.0037), fine = distance(kOdeStep / 10);
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
  RobotDescription carrier = SprungCarrier::Robot(PlantEngine::kOde);
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
  for (const PlantEngine engine : {PlantEngine::kAuto, PlantEngine::kOde}) {
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
  hopper.virtual_robot.engine = PlantEngine::kOde;
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
