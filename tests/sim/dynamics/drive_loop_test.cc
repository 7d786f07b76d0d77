// Drives that run a position loop of their own: against closed forms and Simbody.
#include <catch2/catch.hpp>
#include <cmath>

#include "robot/drive_effort.h"
#include "sim/model.h"
#include "sim/simulator.h"
#include "sim/virtual/simbody_plant.h"
#include "tests/sim/scalar.h"
#include "tests/sim/trees.h"

namespace plumb {
namespace {

using Eigen::VectorXd;
using Integrator = SimulationSettings::Integrator;

constexpr double kLimit = 2;  // [Nm] of the pendulum's motor

// Where nothing but the motor acts.
RobotDescription Wheel(double kp, double kd, double rest, Integrator integrator) {
  RobotDescription robot = Frictionless(LoadPendulum("robot.toml"));
  robot.simulation.gravity = 0;
  robot.simulation.integrator = integrator;
  robot.simulation.substep = 1e-4;
  JointDynamics& joint = robot.joints[0].dynamics;
  joint.kp = kp, joint.kd = kd, joint.rest = rest;
  return robot;
}

double Inertia(const RobotDescription& robot) { return Simulator(robot).MassMatrix()(0, 0); }

TEST_CASE("what a drive makes: the command on top of its loop, as far as the motor can") {
  JointDynamics joint;
  joint.rest = 0.5;
  CHECK(DriveEffort(joint, 10, 3, 1, 1) == 3);
  CHECK(DriveEffort(joint, 10, 30, 1, 1) == 30);  // the driver's limit is not its own
  joint.kp = 4, joint.kd = 0.5;
  CHECK(DriveEffort(joint, 10, 3, 1, 2) == 3 + 4 * -0.5 - 0.5 * 2);
  CHECK(DriveEffort(joint, 10, 3, -9, 2) == 10);
  CHECK(DriveEffort(joint, 10, -3, 9, 2) == -10);
  CHECK(DriveEffort(joint, 0, 0, 9, 2) == 0);  // no motor
}

TEST_CASE("a loop moves a wheel as a spring and a damper do, its command moves where it rests") {
  constexpr double kKp = 3, kKd = 0.4, kRest = 0.2, kTarget = 0.35, kTime = 0.7, kStart = 0.1;
  for (const Integrator integrator : {Integrator::kSemiImplicit, Integrator::kLeapfrog}) {
    const RobotDescription robot = Wheel(kKp, kKd, kRest, integrator);
    Simulator simulator(robot);
    simulator.SetState(Scalar(kStart), Scalar(0));
    simulator.Step(Scalar(kKp * (kTarget - kRest)), kTime);
    // of an underdamped oscillator from rest
    const double inertia = Inertia(robot), decay = kKd / (2 * inertia),
                 rate = std::sqrt(kKp / inertia - decay * decay);
    const double angle = (kStart - kTarget) * std::exp(-decay * kTime) *
                         (std::cos(rate * kTime) + decay / rate * std::sin(rate * kTime));
    CHECK(simulator.q()[0] == Approx(kTarget + angle).margin(1e-4));
    CHECK(std::abs(simulator.q()[0] - kStart) > 0.1);
  }
}

TEST_CASE(
    "at its effort limit a loop is a constant effort, and the motor's gain scales all of it") {
  RobotDescription robot = Wheel(1000, 0.01, 100, Integrator::kSemiImplicit);
  for (const double gain : {1.0, 0.5}) {
    robot.joints[0].dynamics.motor_gain = gain;
    Simulator simulator(robot);
    simulator.SetState(Scalar(0), Scalar(0));
    simulator.Step(Scalar(0), 0.1);
    CHECK(simulator.v()[0] == Approx(gain * kLimit / Inertia(robot) * 0.1));
    simulator.SetState(Scalar(0), Scalar(0));
    simulator.Step(Scalar(-1e6), 0.1);
    CHECK(simulator.v()[0] == Approx(-gain * kLimit / Inertia(robot) * 0.1));
  }
}

TEST_CASE("a loop's motor has no more at a speed than any motor") {
  constexpr double kNoLoad = 6, kTime = 0.4;  // [rad/s], [s]
  for (const Integrator integrator : {Integrator::kSemiImplicit, Integrator::kLeapfrog}) {
    RobotDescription robot = Wheel(50, 1, 1000, integrator);
    robot.joints[0].dynamics.no_load_speed = kNoLoad;
    Simulator simulator(robot);
    simulator.SetState(Scalar(0), Scalar(0));
    simulator.Step(Scalar(0), kTime);
    // I v' = limit (1 - v / no-load speed)
    const double rate = kLimit / (Inertia(robot) * kNoLoad);
    CHECK(simulator.v()[0] == Approx(kNoLoad * (1 - std::exp(-rate * kTime))).epsilon(1e-3));
    CHECK(simulator.v()[0] > 0.5);
  }
}

TEST_CASE("a stiff loop needs no short substeps") {
  for (const Integrator integrator : {Integrator::kSemiImplicit, Integrator::kLeapfrog}) {
    RobotDescription robot = Wheel(500, 5, 0, integrator);
    robot.joints[0].effort_limit = 1e6;
    robot.simulation.substep = 0.05;
    Simulator simulator(robot);
    simulator.SetState(Scalar(1), Scalar(0));
    double largest = 0;
    for (int i = 0; i < 200; ++i) {
      simulator.Step(Scalar(0), 0.05);
      largest = std::max(largest, std::abs(simulator.q()[0]));
    }
    CHECK(largest <= 1);
    CHECK(std::abs(simulator.q()[0]) < 0.05);
  }
}

TEST_CASE("trees with loops, some of them at their limits, move as in Simbody") {
  RobotDescription robot = Frictionless(MakeTree());
  robot.simulation.integrator = Integrator::kLeapfrog;
  robot.simulation.substep = 1e-4;
  double rest = 0.3;
  for (JointDescription& joint : robot.joints) {
    joint.dynamics.kp = 20, joint.dynamics.kd = 0.5, joint.dynamics.rest = rest;
    joint.dynamics.motor_gain = 0.9, joint.passive = false;
    joint.effort_limit = rest > 0 ? 100 : 1.5;
    rest = -rest;
  }
  SimbodyPlant plant(robot, 1e-4);
  Simulator simulator(robot);
  const auto n = static_cast<Eigen::Index>(robot.joints.size());
  const VectorXd q = VectorXd::LinSpaced(n, -0.2, 0.3), v = VectorXd::LinSpaced(n, 0.5, -0.5),
                 effort = VectorXd::LinSpaced(n, -1, 2);
  plant.SetState(q, v);
  simulator.SetState(q, v);
  REQUIRE(plant.Advance(effort, 0.3));
  simulator.Step(effort, 0.3);
  CHECK((simulator.q() - q).norm() > 0.1);
  CHECK((simulator.q() - plant.q()).norm() < 1e-4);
  CHECK((simulator.v() - plant.v()).norm() < 1e-3);
}

}  // namespace
}  // namespace plumb
