#include "sim/virtual/simbody_backend.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "common/random.h"
#include "sim/simulator.h"
#include "sim/virtual/virtual_plant.h"
#include "tests/sim/virtual/advance.h"
#include "tests/sim/virtual/ball.h"

namespace plumb {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

VectorXd Draw(Random& random, const VectorXd& lower, const VectorXd& upper) {
  VectorXd result(lower.size());
  for (Eigen::Index i = 0; i < result.size(); ++i) result[i] = random.Uniform(lower[i], upper[i]);
  return result;
}

/// Of the hopper, its foot in the ground or a little above.
struct HopperPose {
  explicit HopperPose(Random& random) : q(6), v(6), effort(VectorXd::Zero(6)) {
    const VectorXd one = VectorXd::Ones(6);
    q << random.Uniform(-3, 3), 1.25, random.Uniform(-0.2, 0.2), random.Uniform(-0.2, 0),
        random.Uniform(-0.2, 0), random.Uniform(-0.3, 0.3);
    // The lowest point of its straight leg, roughly.
    q[1] = 1.2 - random.Uniform(-0.02, 0.02);
    v = Draw(random, -2 * one, 2 * one);
    effort.tail<3>() = Draw(random, -50 * one.head<3>(), 50 * one.head<3>());
  }
  VectorXd q, v, effort;
};

/// [N] by the header of SimTK::SmoothSphereHalfSpaceForce, of what does not move.
double NormalForce(double depth, double radius) {
  using S = SimbodyBackend;
  const double k = 0.5 * std::pow(S::kModulus, 2. / 3);
  return 4. / 3 * k * std::sqrt(radius * k) * std::pow(depth * depth + S::kSmoothDepth, 0.75) *
         (0.5 + 0.5 * std::tanh(S::kHertzSmoothing * depth));
}

}  // namespace

TEST_CASE("simbody's engine: in flight a hopper has the simulator's accelerations") {
  RobotDescription hopper = Known("hopper");
  SimbodyBackend engine(hopper);
  Simulator simulator(hopper);
  Random random(7);
  for (int i = 0; i < 200; ++i) {
    const HopperPose pose(random);
    const VectorXd q = pose.q + Eigen::Matrix<double, 6, 1>::Unit(1) * 5;
    engine.SetState(q, pose.v);
    simulator.SetState(q, pose.v);
    const VectorXd expected = simulator.Acceleration(pose.effort);
    REQUIRE((engine.Acceleration(pose.effort) - expected).norm() < 1e-9 * (1 + expected.norm()));
    REQUIRE(engine.GroundForce().norm() < 1e-9);
  }
}

TEST_CASE("simbody's engine: what moves a hopper besides its weight is the ground's force") {
  // Its slides' rows of M a + c, by the simulator's M and c: nothing but the ground acts on them.
  RobotDescription hopper = Known("hopper");
  SimbodyBackend engine(hopper);
  Simulator simulator(hopper);
  Random random(8);
  double largest = 0;
  for (int i = 0; i < 200; ++i) {
    const HopperPose pose(random);
    engine.SetState(pose.q, pose.v);
    simulator.SetState(pose.q, pose.v);
    const VectorXd total =
        simulator.MassMatrix() * engine.Acceleration(pose.effort) + simulator.Bias();
    const Vector3d force = engine.GroundForce();
    REQUIRE(std::abs(total[0] - force[0]) < 1e-7);
    REQUIRE(std::abs(total[1] - force[2]) < 1e-7);
    // Within its cone; being smooth, it pulls a little where it comes to nothing.
    REQUIRE(force[2] >= -0.1);
    REQUIRE(std::abs(force[0]) <= (2 + SimbodyBackend::kViscous * 10) * std::abs(force[2]) + 0.1);
    REQUIRE(std::abs(force[1]) < 1e-9);
    largest = std::max(largest, force[2]);
  }
  CHECK(largest > 1000);
}

TEST_CASE("simbody's engine: the ground bears what rests on it, and holds it by its friction") {
  SimbodyBackend engine(Ball());
  const double weight = 2 * 9.81;
  engine.SetState(Vector2d(0, 0.11), Vector2d::Zero());
  REQUIRE(Advance(engine, Vector2d(0, 0), 4));
  CHECK(engine.v().norm() < 1e-3);
  CHECK(engine.GroundForce()[2] == Approx(weight).epsilon(1e-3));
  CHECK(NormalForce(0.1 - engine.q()[1], 0.1) == Approx(weight).epsilon(1e-3));
  const double height = engine.q()[1];
  const auto slid = [&](double push) {
    engine.SetState(Vector2d(0, height), Vector2d::Zero());
    REQUIRE(Advance(engine, Vector2d(push * weight, 0), 1));
    return engine.q()[0];
  };
  CHECK(slid(0.3) < SimbodyBackend::kTransition * 1);  // it creeps
  CHECK(slid(0.9) == Approx(0.5 * (0.9 - 0.4) * 9.81).epsilon(0.05));
}

TEST_CASE("simbody's engine: a ball that bounces only loses energy") {
  for (const double factor : {1.0, 5.0}) {
    RobotDescription ball = Ball();
    ball.virtual_robot.ground.stiffness_factor = factor;
    SimbodyBackend engine(ball);
    engine.SetState(Vector2d(0, 0.6), Vector2d(1, 0));
    const auto energy = [&] {
      return 2 * (9.81 * (engine.q()[1] - 0.1) + engine.v().squaredNorm() / 2);
    };
    const double before = energy();
    double in_flight = before;
    int bounces = 0;
    bool touched = false;
    for (int i = 0; i < 3000; ++i) {
      REQUIRE(engine.Advance(Vector2d(0, 0), 1e-3));
      if (engine.q()[1] < 0.11) {
        touched = true;
        continue;
      }
      REQUIRE(energy() < in_flight + 1e-4 * before);
      bounces += touched;
      touched = false;
      in_flight = energy();
    }
    CHECK(bounces >= 1);
    CHECK(in_flight < 0.7 * before);
  }
}

TEST_CASE("simbody's engine: a stop gives way as its stiffness says") {
  RobotDescription hopper = Known("hopper");
  hopper.simulation.gravity = 0;
  // The foot alone: it is pushed beyond its limit, and nothing else can move.
  for (size_t i = 0; i < 5; ++i) hopper.joints[i].dynamics.armature = 1e9;
  SimbodyBackend engine(hopper);
  VectorXd q = VectorXd::Zero(6), effort = VectorXd::Zero(6);
  q[1] = 9;
  effort[5] = 100;
  engine.SetState(q, 0 * q);
  REQUIRE(Advance(engine, effort, 4));
  CHECK(engine.q()[5] - hopper.joints[5].upper ==
        Approx(100 / SimbodyBackend::kStopStiffness).epsilon(1e-3));
  CHECK(std::abs(engine.v()[5]) < 1e-4);
}

TEST_CASE("simbody's engine: steps are as short as their error asks, and the same each time") {
  const RobotDescription hopper = Known("hopper");
  SimbodyBackend engine(hopper), again(hopper), fine(hopper);
  VectorXd q = VectorXd::Zero(6), effort = VectorXd::Zero(6);
  q[1] = 1.3;
  effort.tail<3>() << -20, -30, 10;
  engine.SetState(q, 0 * q);
  fine.SetState(q, 0 * q);
  again.SetState(q, 0 * q);
  REQUIRE(Advance(again, -effort, 0.2));  // whatever was before
  again.SetState(q, 0 * q);
  REQUIRE(Advance(engine, effort, 0.185));
  REQUIRE(Advance(again, effort, 0.185));
  double largest = 0;
  for (int i = 0; i < 3700; ++i) {
    REQUIRE(fine.Advance(effort, 5e-5));
    largest = std::max(largest, fine.GroundForce()[2]);
  }
  CHECK(engine.q() == again.q());
  CHECK(engine.v() == again.v());
  CHECK(largest > 1000);  // it has landed
  CHECK((engine.q() - fine.q()).norm() < 1e-4);
  CHECK((engine.v() - fine.v()).norm() < 1e-2);
}

TEST_CASE("simbody's engine: numbers that are none, and what it cannot be told") {
  const auto engine = MakeSimbodyBackend(Ball());
  const Vector2d q(0, 0.5), v(1, 2);
  engine->SetState(q, v);
  CHECK_FALSE(engine->Advance(q * std::numeric_limits<double>::quiet_NaN(), 0.01));
  CHECK_FALSE(engine->Advance(Vector2d(1e308, 1e308), 1));
  CHECK(engine->q() == q);
  CHECK(engine->v() == v);
  CHECK(engine->Advance(Vector2d(0, 0), 0.01));
  CHECK_THROWS_AS(engine->SetState(q * std::numeric_limits<double>::infinity(), v),
                  std::invalid_argument);
  CHECK_THROWS_AS(engine->SetState(VectorXd::Ones(3), v), std::invalid_argument);

  RobotDescription hopper = Known("hopper");
  hopper.virtual_robot.engine = VirtualRobotSettings::Engine::kSimbody;
  hopper.virtual_robot.engine_source = "robot.toml:7:1: ";
  CHECK_NOTHROW(VirtualPlant(hopper));
  hopper.links[6].collisions[0].type = Shape::Type::kBox;
  CHECK_THROWS_WITH(VirtualPlant(hopper),
                    Catch::Equals("robot.toml:7:1: virtual_robot.engine = \"simbody\" is not "
                                  "possible: the edges of link 'foot'"));
  hopper.joints[4].dynamics.delay = 0.01;
  CHECK_THROWS_WITH(VirtualPlant(hopper),
                    Catch::Contains("delays and sensor errors of joint 'leg'"));
}

}  // namespace plumb
