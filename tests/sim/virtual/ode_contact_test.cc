// ODE's engine where it touches: ground and stops.

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "sim/virtual/mujoco_backend.h"
#include "sim/virtual/ode_backend.h"
#include "sim/virtual/simbody_backend.h"
#include "sim/virtual/virtual_plant.h"
#include "tests/sim/virtual/advance.h"
#include "tests/sim/virtual/ball.h"

namespace plumb {
namespace {

using Eigen::Vector2d;
using Eigen::VectorXd;
using PlantEngine = VirtualRobotSettings::Engine;

/// The ball on a ground of its own, moved by ODE.
VirtualPlant BallOn(const UnmodelledGround& ground) {
  RobotDescription ball = Ball();
  ball.virtual_robot.engine = PlantEngine::kOde;
  ball.virtual_robot.ground = ground;
  return VirtualPlant(ball);
}

Vector2d After(VirtualPlant plant, const Vector2d& q, const Vector2d& v, double duration) {
  plant.SetState(q, v);
  for (double t = 0; t < duration; t += 0.0037)
    REQUIRE(plant.Advance(Vector2d::Zero(), std::min(0.0037, duration - t)));
  return plant.q();
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

}  // namespace
TEST_CASE("engines that know the ground alone refuse links that touch each other") {
  RobotDescription hopper = Known("hopper");
  hopper.links[0].collisions.push_back({.type = Shape::Type::kBox, .size = {1, 1, 1}});
  hopper.simulation.link_pairs = {{hopper.links[0].name, hopper.links.back().name}};
  using Catch::Contains;
  const std::string what = "contact of links with each other or with shapes of the base";
  CHECK_THROWS_WITH(MakeOdeBackend(hopper), Contains(what));
  CHECK_THROWS_WITH(MakeSimbodyBackend(hopper), Contains(what));
  CHECK_NOTHROW(MakeMujocoBackend(hopper));
}

}  // namespace plumb
