// Gears that pass on only a share of the effort that drives.
#include <catch2/catch.hpp>
#include <cmath>

#include "sim/model.h"
#include "sim/simulator.h"
#include "sim/virtual/simbody_plant.h"
#include "tests/sim/trees.h"

namespace plumb {
namespace {

using Eigen::VectorXd;

constexpr double kStep = 0.01;

// Where nothing but the motor acts.
RobotDescription Wheel(double efficiency) {
  RobotDescription robot = Frictionless(LoadPendulum("robot.toml"));
  robot.simulation.gravity = 0;
  robot.joints[0].dynamics.gear_efficiency = efficiency;
  return robot;
}

VectorXd One(double value) { return VectorXd::Constant(1, value); }

double ChangeOfSpeed(const RobotDescription& robot, double speed, double effort) {
  Simulator simulator(robot);
  simulator.SetState(One(0), One(speed));
  simulator.Step(One(effort), kStep);
  return simulator.v()[0] - speed;
}

TEST_CASE("a gear passes on its share of an effort that drives, and all of one that brakes") {
  for (const double effort : {0.3, -0.3}) {
    const double whole = ChangeOfSpeed(Wheel(1), 5, effort);
    for (const double efficiency : {0.9, 0.5, 0.01}) {
      const double forwards = ChangeOfSpeed(Wheel(efficiency), 5, effort),
                   backwards = ChangeOfSpeed(Wheel(efficiency), -5, effort);
      CHECK(forwards == Approx((effort > 0 ? efficiency : 1) * whole).epsilon(1e-4));
      CHECK(backwards == Approx((effort < 0 ? efficiency : 1) * whole).epsilon(1e-4));
    }
  }
}

TEST_CASE("a joint holds still under a load that its motor can hold but not lift") {
  RobotDescription robot = Frictionless(LoadPendulum("robot.toml"));
  robot.joints[0].dynamics.gear_efficiency = 0.6;
  Simulator simulator(robot);
  const VectorXd q = One(1.2);
  simulator.SetState(q, One(0));
  const double load = simulator.Bias()[0];
  for (const double share : {1.05, 1.3, 1.6}) {  // of the load; 1 / 0.6 would lift it
    simulator.SetState(q, One(0));
    for (int i = 0; i < 100; ++i) simulator.Step(One(share * load), kStep);
    CHECK(std::abs(simulator.v()[0]) < 0.02);
    CHECK(std::abs(simulator.q()[0] - q[0]) < 0.02);
  }
  for (const double share : {0.8, 2.0}) {
    simulator.SetState(q, One(0));
    for (int i = 0; i < 20; ++i) simulator.Step(One(share * load), kStep);
    CHECK(simulator.v()[0] * (share - 1) * load > 0);
    CHECK(std::abs(simulator.q()[0] - q[0]) > 0.02);
  }
}

TEST_CASE("a gear without losses is none, uncertain or not") {
  RobotDescription certain = Frictionless(LoadExample("double_pendulum")), uncertain = certain;
  uncertain.parameters = {{"gear_efficiency/" + certain.joints[0].name, "",
                           ParameterDescription::Coordinate::kLogit, 0.9, 0.001, 0.5, 1.0}};
  Simulator one(certain), other(uncertain);
  other.SetParameters(One(1));
  for (Simulator* simulator : {&one, &other})
    simulator->SetState(Eigen::Vector2d(0.5, -1), Eigen::Vector2d(2, 1));
  for (int i = 0; i < 50; ++i) {
    for (Simulator* simulator : {&one, &other}) simulator->Step(Eigen::Vector2d(3, -1), kStep);
  }
  CHECK((one.q() - other.q()).norm() < 1e-12);
  CHECK((one.v() - other.v()).norm() < 1e-12);
  CHECK_THROWS_AS(other.SetParameters(One(1.1)), std::invalid_argument);
  CHECK_THROWS_AS(other.SetParameters(One(0)), std::invalid_argument);
}

// Derivatives of what a motion of driving and braking becomes: were they in line, no log could tell
// the parameters apart.
TEST_CASE("it is told from the motor's gain and from friction") {
  const auto motion = [](double efficiency, double gain, double friction) {
    RobotDescription robot = Wheel(efficiency);
    robot.joints[0].dynamics.motor_gain = gain;
    robot.joints[0].dynamics.friction = friction;
    Simulator simulator(robot);
    simulator.SetState(One(0), One(2));
    VectorXd speeds(60);
    for (int i = 0; i < 60; ++i) {
      simulator.Step(One((i < 30 ? 1 : 0.3) * std::sin(0.3 * i)), kStep);
      speeds[i] = simulator.v()[0];
    }
    return speeds;
  };
  Eigen::Matrix<double, 60, 3> columns;
  const VectorXd at = motion(0.8, 1, 0.05);
  columns.col(0) = motion(0.81, 1, 0.05) - at;
  columns.col(1) = motion(0.8, 1.01, 0.05) - at;
  columns.col(2) = motion(0.8, 1, 0.06) - at;
  columns.colwise().normalize();
  const Eigen::Matrix3d cosines = columns.transpose() * columns;
  CHECK(cosines.determinant() > 1e-3);
}

TEST_CASE("physics without such gears say so") {
  CHECK(SimbodyPlant::Lacks(Wheel(1)) == "");
  CHECK(SimbodyPlant::Lacks(Wheel(0.9)) == "the gear's losses of joint 'pivot'");
}

}  // namespace
}  // namespace plumb
