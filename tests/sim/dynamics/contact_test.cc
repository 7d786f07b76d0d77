// Forces that come and go: ground, stops, friction; and springs and motors.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "sim/dynamics/constraints.h"
#include "sim/dynamics/planar_tree.h"
#include "sim/simulator.h"
#include "tests/sim/scalar.h"
#include "tests/sim/trees.h"

namespace plumb {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;
using Integrator = SimulationSettings::Integrator;
using Type = JointDescription::Type;

constexpr double kGravity = 9.81;
constexpr double kStickSpeed = Constraints<double, PlanarTree>::kStickSpeed;

// One body of 2 kg on a joint (or, with a floating joint, free), its frame at its centre of mass.
RobotDescription Body(const std::string& type, const std::string& axis, double substep,
                      Integrator integrator) {
  RobotDescription robot = FromUrdf(
      "<robot name='body'><link name='base'/><link name='body'><inertial><mass value='2'/>"
      "<inertia ixx='.05' iyy='.05' izz='.05' ixy='0' ixz='0' iyz='0'/></inertial></link>"
      "<joint name='j' type='" +
      type + "'><parent link='base'/><child link='body'/><axis xyz='" + axis +
      "'/><limit lower='-1' upper='1' effort='10' velocity='9'/></joint></robot>");
  robot.simulation.gravity = kGravity;
  robot.simulation.substep = substep;
  robot.simulation.integrator = integrator;
  return robot;
}

RobotDescription Ball(double substep, Integrator integrator) {
  RobotDescription robot = Body("floating", "1 0 0", substep, integrator);
  robot.simulation.contact = {
      .stiffness = 5000, .damping = 150, .friction = 0.5, .slip_speed = 0.01};
  Shape shape;
  shape.size = Vector3d(0.1, 0, 0);
  robot.links.back().collisions = {shape};
  return robot;
}

// Slides on the ground without turning: three slides and four feet below.
RobotDescription Sled(double substep, Integrator integrator) {
  RobotDescription robot = Ball(substep, integrator);
  robot.joints.pop_back();
  robot.links.pop_back();
  robot.links.back() = {.name = "sled", .mass = 2, .inertia = .05 * Eigen::Matrix3d::Identity()};
  Shape box;
  box.type = Shape::Type::kBox;
  box.size = Vector3d(0.4, 0.2, 0.2);
  robot.links.back().collisions = {box};
  return robot;
}

VectorXd BallState(double height) {
  VectorXd q = VectorXd::Zero(7);
  q[2] = height;
  q[3] = 1;
  return q;
}

}  // namespace

TEST_CASE("contact: a ball comes to rest as deep as its weight presses it") {
  for (const auto integrator : {Integrator::kSemiImplicit, Integrator::kLeapfrog}) {
    for (const double substep : {0.0005, 0.004, 0.02}) {
      Simulator simulator(Ball(substep, integrator));
      simulator.SetState(BallState(0.5), VectorXd::Zero(6));
      double lowest = 1;
      for (int i = 0; i < 250; ++i) {
        simulator.Step(VectorXd::Zero(6), 0.02);
        lowest = std::min(lowest, simulator.q()[2]);
      }
      CHECK(lowest > -0.1);
      CHECK(simulator.q()[2] == Approx(0.1 - 2 * kGravity / 5000).margin(1e-7));
      CHECK(simulator.v().norm() < 1e-5);
    }
  }
}

TEST_CASE("contact: before it touches the ground a ball falls freely") {
  Simulator simulator(Ball(0.001, Integrator::kLeapfrog));
  simulator.SetState(BallState(0.1 + 0.01), VectorXd::Zero(6));
  simulator.Step(VectorXd::Zero(6), 0.044);
  CHECK(simulator.v()[2] == Approx(-kGravity * 0.044).epsilon(1e-9));
  simulator.Step(VectorXd::Zero(6), 0.004);
  CHECK(simulator.v()[2] > -kGravity * 0.048 + 0.005);
}

TEST_CASE("contact: the ground never pulls, and gives back no more than it got") {
  for (const auto integrator : {Integrator::kSemiImplicit, Integrator::kLeapfrog}) {
    for (const double substep : {0.0005, 0.002, 0.008}) {
      for (const double damping : {0.0, 20.0, 150.0, 2000.0}) {
        RobotDescription robot = Ball(substep, integrator);
        robot.simulation.contact->damping = damping;
        Simulator simulator(robot);
        // Out of the ground at any speed.
        for (const double up : {0.0, 0.1, 1.0, 10.0}) {
          for (const double depth : {1e-4, 1e-3, 1e-2}) {
            VectorXd v = VectorXd::Zero(6);
            v[2] = up;
            simulator.SetState(BallState(0.1 - depth), v);
            for (int i = 0; i < 20; ++i) {
              const double before = simulator.v()[2];
              simulator.Step(VectorXd::Zero(6), substep);
              REQUIRE(simulator.v()[2] >= before - kGravity * substep - 1e-12);
            }
          }
        }
        // A fall of half a metre.
        VectorXd v = VectorXd::Zero(6);
        v[0] = 3;
        simulator.SetState(BallState(0.6), v);
        const double start = 0.5 * 2 * 9 + 2 * kGravity * 0.6;
        for (int i = 0; i < 250; ++i) {
          simulator.Step(VectorXd::Zero(6), 0.008);
          const VectorXd& now = simulator.v();
          const double depth = std::max(0.0, 0.1 - simulator.q()[2]);
          const double energy = now.head<3>().squaredNorm() + 0.025 * now.tail<3>().squaredNorm() +
                                2 * kGravity * simulator.q()[2] + 2500 * depth * depth;
          REQUIRE(energy < start * 1.02);
        }
      }
    }
  }
}

TEST_CASE("contact: what slides is slowed by friction times gravity, in any direction, and stops") {
  for (const auto integrator : {Integrator::kSemiImplicit, Integrator::kLeapfrog}) {
    for (const double direction : {0.0, 1.0, 2.5, 4.4}) {
      Simulator simulator(Sled(0.001, integrator));
      const double depth = 2 * kGravity / (4 * 5000);
      const Vector3d way(std::cos(direction), std::sin(direction), 0);
      simulator.SetState(Vector3d(0, 0, 0.1 - depth), 2 * way);
      simulator.Step(VectorXd::Zero(3), 0.1);
      CHECK((simulator.v() - (2 - 0.5 * kGravity * 0.1) * way).norm() < 1e-3);
      simulator.Step(VectorXd::Zero(3), 0.2);
      CHECK((simulator.v() - (2 - 0.5 * kGravity * 0.3) * way).norm() < 1e-3);
      simulator.Step(VectorXd::Zero(3), 0.2);
      CHECK(simulator.v().norm() < 1e-3);
      CHECK((simulator.q().head<2>() - way.head<2>() * 2 * 2 / (2 * 0.5 * kGravity)).norm() < 2e-3);
    }
  }
}

TEST_CASE("contact: within the cone a push creeps, beyond it accelerates by the rest") {
  for (const auto integrator : {Integrator::kSemiImplicit, Integrator::kLeapfrog}) {
    Simulator simulator(Sled(0.002, integrator));
    const double weight = 2 * kGravity, depth = weight / (4 * 5000);
    for (const double share : {0.5, 0.9}) {
      simulator.SetState(Vector3d(0, 0, 0.1 - depth), Vector3d::Zero());
      const Vector3d push = 0.5 * weight * share * Vector3d(0.6, -0.8, 0);
      simulator.Step(push, 1);
      CHECK((simulator.v() - share * 0.01 * Vector3d(0.6, -0.8, 0)).norm() < 1e-4);  // slip_speed
    }
    simulator.SetState(Vector3d(0, 0, 0.1 - depth), Vector3d::Zero());
    simulator.Step(Vector3d(1.5 * 0.5 * weight, 0, 0), 1);
    CHECK(simulator.v()[0] == Approx(0.5 * 0.5 * kGravity).margin(0.02));
    // Pressed down it grips more, lifted less.
    for (const double lift : {-10.0, 10.0}) {
      simulator.SetState(Vector3d(0, 0, 0.1 - (weight - lift) / (4 * 5000)), Vector3d(5, 0, 0));
      simulator.Step(Vector3d(0, 0, lift), 0.5);
      CHECK(simulator.v()[0] == Approx(5 - 0.5 * (weight - lift) / 2 * 0.5).margin(2e-3));
    }
  }
}

TEST_CASE("contact: a sliding ball begins to roll, at five sevenths of its speed") {
  RobotDescription robot = Ball(0.0005, Integrator::kSemiImplicit);
  robot.links.back().inertia = 0.4 * 2 * 0.01 * Eigen::Matrix3d::Identity();
  robot.simulation.contact->slip_speed = 0.001;
  Simulator simulator(robot);
  VectorXd v = VectorXd::Zero(6);
  v[0] = 1.4;
  simulator.SetState(BallState(0.1 - 2 * kGravity / 5000), v);
  simulator.Step(VectorXd::Zero(6), 0.5);
  CHECK(simulator.v()[0] == Approx(1.0).epsilon(0.002));
  // about y, in link axes that have turned about y only
  CHECK(simulator.v()[4] == Approx(10.0).epsilon(0.002));
}

TEST_CASE("contact: the hopper survives any actions on any ground at any substep") {
  int grounded = 0;
  for (const double substep : {0.002, 0.004, 0.008}) {
    for (const double stiffness : {5e3, 2e4, 1e5}) {
      for (const auto integrator : {Integrator::kSemiImplicit, Integrator::kLeapfrog}) {
        RobotDescription robot = LoadExample("hopper");
        robot.simulation.substep = substep;
        robot.simulation.integrator = integrator;
        robot.simulation.contact->stiffness = stiffness;
        Simulator simulator(robot);
        Random random(1);
        VectorXd effort = VectorXd::Zero(6), q = VectorXd::Zero(6);
        q[1] = 1.25;
        simulator.SetState(q, VectorXd::Zero(6));
        for (int i = 0; i < 2000; ++i) {
          for (int k = 3; k < 6; ++k)
            effort[k] = random.Uniform() < 0.5 ? random.Uniform(-200, 200)
                                               : (random.Uniform() < 0.5 ? 200 : -200);
          if (i % 100 == 99) simulator.SetState(q, DrawNumbers(6, random, 3));
          simulator.Step(effort, 0.008);
          REQUIRE(simulator.finite());
          REQUIRE(simulator.v().cwiseAbs().maxCoeff() < 300);
          REQUIRE(simulator.q()[1] < 30);
          grounded += simulator.q()[1] < 1.3;
        }
      }
    }
  }
  CHECK(grounded > 1000);
}

TEST_CASE("stops: a joint is held at its limits, whatever pushes it there") {
  for (const auto integrator : {Integrator::kSemiImplicit, Integrator::kLeapfrog}) {
    for (const auto& [type, inertia] : {std::pair{"prismatic", 2.0}, {"revolute", 0.05}}) {
      for (const double substep : {0.001, 0.02}) {
        for (const double side : {1.0, -1.0}) {
          RobotDescription robot = Body(type, "0 1 0", substep, integrator);
          robot.simulation.stop = {.stiffness = 2000, .damping = 30};
          Simulator simulator(robot);
          simulator.SetState(Scalar(0.5 * side), Scalar(4 * side));
          for (int i = 0; i < 250; ++i) {
            simulator.Step(Scalar(10 * side), 0.04);
            REQUIRE(std::abs(simulator.q()[0]) < 1.2);
          }
          CHECK(simulator.q()[0] == Approx(side * (1 + 10.0 / 2000)).epsilon(1e-6));
          simulator.Step(Scalar(-10 * side), 0.02);  // and let go without a pull
          const double speed = -side * simulator.v()[0];
          CHECK(speed > 0.9 * 10 / inertia * 0.02);
          robot.simulation.stop.reset();
          Simulator endless(robot);
          endless.Step(Scalar(10), 2);
          CHECK(endless.q()[0] > 2);
        }
      }
    }
  }
}

TEST_CASE("friction: sticks below its force, and takes its force off above it") {
  for (const auto integrator : {Integrator::kSemiImplicit, Integrator::kLeapfrog}) {
    for (const auto& [type, inertia] : {std::pair{"prismatic", 2.0}, {"continuous", 0.05}}) {
      RobotDescription robot = Body(type, "0 1 0", 0.005, integrator);
      robot.joints[0].dynamics.friction = 3;
      Simulator simulator(robot);
      for (const double side : {1.0, -1.0}) {
        simulator.SetState(Scalar(0), Scalar(0));
        simulator.Step(Scalar(2.9 * side), 3);
        CHECK(std::abs(simulator.v()[0]) < kStickSpeed);
        CHECK(std::abs(simulator.q()[0]) < 3 * kStickSpeed);
        // Creeps as fast as viscous friction lets it: no faster than the share of the force.
        CHECK(simulator.v()[0] == Approx(2.9 / 3 * kStickSpeed * side).epsilon(1e-3));
        simulator.SetState(Scalar(0), Scalar(0));
        simulator.Step(Scalar(4 * side), 1);
        CHECK(simulator.v()[0] == Approx(side / inertia).epsilon(0.02));
        // Unpowered it is slowed evenly, then stops.
        simulator.SetState(Scalar(0), Scalar(2 * side * 0.1 / inertia));
        simulator.Step(Scalar(0), 0.05);
        CHECK(simulator.v()[0] == Approx(side * (0.2 - 3 * 0.05) / inertia).epsilon(1e-9));
        simulator.Step(Scalar(0), 0.2);
        CHECK(std::abs(simulator.v()[0]) < 1e-3);
      }
    }
  }
}

TEST_CASE("springs: a mass on one swings at its frequency, and stiff ones are stable") {
  const double stiffness = 200, period = 2 * std::numbers::pi * std::sqrt(2.0 / stiffness);
  RobotDescription robot = Body("prismatic", "1 0 0", period / 1000, Integrator::kLeapfrog);
  robot.joints[0].dynamics.stiffness = stiffness;
  robot.joints[0].dynamics.rest = 0.3;
  Simulator simulator(robot);
  simulator.SetState(Scalar(0.5), Scalar(0));
  simulator.Step(Scalar(0), 10 * period);
  CHECK(simulator.q()[0] == Approx(0.5).margin(1e-5));
  simulator.Step(Scalar(0), period / 4);
  CHECK(simulator.q()[0] == Approx(0.3).margin(1e-4));
  CHECK(simulator.v()[0] == Approx(-0.2 * 2 * std::numbers::pi / period).epsilon(1e-4));
  // A constant force moves the rest by force / stiffness.
  robot.joints[0].dynamics.damping = 20;
  Simulator damped(robot);
  damped.Step(Scalar(8), 5);
  CHECK(damped.q()[0] == Approx(0.3 + 8 / stiffness).epsilon(1e-9));

  for (const auto integrator : {Integrator::kSemiImplicit, Integrator::kLeapfrog}) {
    RobotDescription stiff = Body("prismatic", "1 0 0", 0.01, integrator);
    stiff.joints[0].dynamics.stiffness = 1e8;
    Simulator held(stiff);
    held.SetState(Scalar(0.01), Scalar(0));
    for (int i = 0; i < 2000; ++i) {
      held.Step(Scalar(0), 0.01);
      REQUIRE(std::abs(held.q()[0]) < 0.0101);
    }
  }
}

TEST_CASE("motors: gain scales, and back-EMF takes from the effort along the speed alone") {
  for (const auto integrator : {Integrator::kSemiImplicit, Integrator::kLeapfrog}) {
    RobotDescription robot = Body("continuous", "0 0 1", 1e-5, integrator);
    robot.joints[0].dynamics.motor_gain = 0.8;
    robot.joints[0].dynamics.no_load_speed = 20;
    Simulator simulator(robot);
    // effort limit 10: at speed w no more than 10 (1 - |w| / 20) along it.
    const auto acceleration = [&](double speed, double effort) {
      simulator.SetState(Scalar(0), Scalar(speed));
      return simulator.Acceleration(Scalar(effort))[0] * 0.05;
    };
    for (const double side : {1.0, -1.0}) {
      CHECK(acceleration(0, side * 10) == Approx(0.8 * side * 10));
      CHECK(acceleration(side * 5, side * 10) == Approx(0.8 * side * 7.5));
      CHECK(acceleration(side * 5, side * 7) == Approx(0.8 * side * 7));
      CHECK(acceleration(side * 5, side * -10) == Approx(0.8 * side * -10));
      CHECK(acceleration(side * 30, side * 1) == Approx(0).margin(1e-12));
      CHECK(acceleration(side * 30, side * -10) == Approx(0.8 * side * -10));
      // It comes to its no-load speed exponentially.
      simulator.SetState(Scalar(0), Scalar(0));
      simulator.Step(Scalar(side * 10), 0.1);
      const double rate = 0.8 * 10 / 20 / 0.05;
      CHECK(simulator.v()[0] == Approx(side * 20 * (1 - std::exp(-rate * 0.1))).epsilon(1e-4));
    }
  }
}

}  // namespace plumb
