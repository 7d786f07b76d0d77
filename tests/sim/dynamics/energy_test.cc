// The invariants of free motion, and how fast the integrators come to the truth.
#include <algorithm>
#include <catch2/catch.hpp>

#include "sim/simulator.h"
#include "tests/sim/trees.h"

namespace plumb {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;
using Integrator = SimulationSettings::Integrator;
using Type = JointDescription::Type;

RobotDescription Leaping(RobotDescription robot, double substep) {
  robot.simulation.integrator = Integrator::kLeapfrog;
  robot.simulation.substep = substep;
  return robot;
}

double KineticEnergy(Simulator& simulator) {
  return 0.5 * simulator.v().dot(simulator.MassMatrix() * simulator.v());
}

// How far the energy strays within 10 s, as a share of what moves back and forth between its two
// kinds.
double Drift(const RobotDescription& robot, Simulator& simulator) {
  const auto energy = [&] {
    return KineticEnergy(simulator) + PotentialEnergy(robot, simulator.q());
  };
  const double start = energy();
  double worst = 0, most = KineticEnergy(simulator), least = most;
  const VectorXd none = VectorXd::Zero(robot.num_velocities());
  for (int i = 0; i < 100; ++i) {
    simulator.Step(none, 0.1);
    REQUIRE(simulator.finite());
    worst = std::max(worst, std::abs(energy() - start));
    most = std::max(most, KineticEnergy(simulator));
    least = std::min(least, KineticEnergy(simulator));
  }
  CHECK(most - least > 0.1);  // [J]: it did move
  return worst / (most - least);
}

// Three bodies that float: hinge and ball joint between them, in axes of their own.
std::string FloatingChain() {
  const auto body = [](const std::string& name, const std::string& inertia) {
    return "<link name='" + name +
           "'><inertial><origin xyz='.05 -.1 .2' rpy='.3 .2 .1'/><mass value='1.5'/><inertia " +
           inertia + "/></inertial></link>";
  };
  return "<robot name='chain'><link name='base'/>" +
         body("a", "ixx='.05' iyy='.06' izz='.03' ixy='.01' ixz='0' iyz='.004'") +
         body("b", "ixx='.02' iyy='.03' izz='.02' ixy='0' ixz='.003' iyz='0'") +
         body("c", "ixx='.01' iyy='.012' izz='.02' ixy='0' ixz='0' iyz='0'") +
         "<joint name='free' type='floating'><parent link='base'/><child link='a'/><origin xyz='0 "
         "0 1' rpy='.5 -.4 1'/></joint>"
         "<joint name='hinge' type='continuous'><parent link='a'/><child link='b'/><origin xyz='.1 "
         ".1 .4' rpy='1 .2 0'/>"
         "<axis xyz='1 2 -1'/><limit effort='0' velocity='9'/></joint>"
         "<joint name='slide' type='prismatic'><parent link='b'/><child link='c'/><origin xyz='.2 "
         "0 .3' rpy='0 1 2'/>"
         "<axis xyz='0 1 1'/><limit lower='-9' upper='9' effort='0' velocity='9'/></joint></robot>";
}

// A body that floats and whose link frame is its centre of mass.
RobotDescription Top(const Vector3d& moments) {
  RobotDescription robot = FromUrdf(
      "<robot name='top'><link name='base'/><link name='top'><inertial><mass value='2'/>"
      "<inertia ixx='.02' iyy='.02' izz='.02' ixy='0' ixz='0' iyz='0'/></inertial></link>"
      "<joint name='free' type='floating'><parent link='base'/><child link='top'/><origin xyz='1 2 "
      "3' rpy='.5 -.4 1'/></joint></robot>");
  robot.links.back().inertia = moments.asDiagonal();
  return robot;
}

// About the origin of the top's joint [kg m^2/s], base axes.
Vector3d SpinMomentum(const RobotDescription& robot, const Simulator& simulator) {
  const Eigen::Matrix3d turned = LinkPoses(robot, simulator.q()).back().linear();
  return turned * robot.links.back().inertia * simulator.v().tail<3>();
}

VectorXd TopState(const RobotDescription& robot) {
  VectorXd q = VectorXd::Zero(robot.num_positions());
  q.tail<4>() << 0.5, -0.5, 0.7, 0.1;
  q.tail<4>().normalize();
  return q;
}

}  // namespace

TEST_CASE("energy: the examples keep it to a millionth over ten seconds") {
  for (const char* name : {"pendulum", "cartpole", "double_pendulum", "hopper"}) {
    INFO(name);
    const RobotDescription robot = Leaping(Frictionless(LoadExample(name)), 1e-4);
    Simulator simulator(robot);
    Random random(1);
    simulator.SetState(DrawPosition(robot, random, 2),
                       DrawNumbers(robot.num_velocities(), random, 1));
    const double drift = Drift(robot, simulator);
    CHECK(drift < 1e-6);
  }
}

TEST_CASE("energy: a floating chain in space keeps it, on springs, too") {
  for (const double stiffness : {0.0, 30.0}) {
    RobotDescription robot = Leaping(FromUrdf(FloatingChain()), 1e-4);
    robot.joints.back().dynamics.stiffness = 30;  // or the slide would leave
    robot.joints.back().dynamics.rest = 0.1;
    robot.joints[robot.joints.size() - 2].dynamics.stiffness = stiffness;
    Simulator simulator(robot);
    Random random(2);
    simulator.SetState(DrawPosition(robot, random, .1),
                       DrawNumbers(robot.num_velocities(), random, 2));
    const double drift = Drift(robot, simulator);
    CHECK(drift < 1e-6);
  }
}

TEST_CASE("energy: momentum of a floating chain is its weight's impulse") {
  const RobotDescription robot = Leaping(FromUrdf(FloatingChain()), 1e-3);
  Simulator simulator(robot);
  Random random(3);
  simulator.SetState(DrawPosition(robot, random, .1),
                     DrawNumbers(robot.num_velocities(), random, 2));
  // Of the whole robot along a slide of its own: the row of the mass matrix; base axes.
  const Eigen::Matrix3d axes = robot.joints[0].rotation;
  const auto momentum = [&] {
    return Vector3d(axes * (simulator.MassMatrix().topRows<3>() * simulator.v()));
  };
  const Vector3d before = momentum();
  simulator.Step(VectorXd::Zero(robot.num_velocities()), 1);
  const Vector3d gained = momentum() - before;
  CHECK((gained - Vector3d(0, 0, -4.5 * robot.simulation.gravity)).norm() < 2e-4);
}

TEST_CASE(
    "energy: a tumbling body keeps angular momentum, energy and the length of its quaternion") {
  const RobotDescription shape = Top({.01, .02, .025});
  double errors[2];
  for (const int fine : {0, 1}) {
    const RobotDescription robot = Leaping(shape, fine ? 5e-4 : 1e-3);
    Simulator simulator(robot);
    VectorXd v(6);
    v << 1, 2, 3, .3, 5, -.2;  // about the middle axis: it will tumble
    simulator.SetState(TopState(robot), v);
    const Vector3d before = SpinMomentum(robot, simulator);
    const double energy = KineticEnergy(simulator);
    double least = 1, worst = 0;
    for (int i = 0; i < 100; ++i) {
      simulator.Step(VectorXd::Zero(6), 0.1);
      REQUIRE(std::abs(simulator.q().tail<4>().norm() - 1) < 1e-14);
      worst = std::max(worst, (SpinMomentum(robot, simulator) - before).norm() / before.norm());
      least = std::min(least, simulator.v()[4]);
    }
    CHECK(least < -4);  // it tumbled
    const Vector3d spin = simulator.v().tail<3>();
    const double turning = 0.5 * spin.dot(robot.links.back().inertia * spin);
    const double at_first = energy - 0.5 * 2 * 14;
    CHECK(turning == Approx(at_first).epsilon(1e-4));
    errors[fine] = worst;
  }
  CHECK(errors[0] < 1e-3);
  CHECK(errors[0] / errors[1] == Approx(4).margin(0.4));
}

TEST_CASE("energy: a symmetric top precesses as the closed form says, and falls as a stone") {
  // L is fixed in space and 3 the axis of symmetry: R(t) = exp(t L/I1) R(0) exp(t (1 - I3/I1) w3).
  const double across = .02, along = .03, time = 2;
  const auto error = [&](Integrator integrator, double substep) {
    RobotDescription robot = Top({across, across, along});
    robot.simulation.integrator = integrator;
    robot.simulation.substep = substep;
    Simulator simulator(robot);
    VectorXd v(6);
    v << .1, .2, .3, 2, -1, 6;
    simulator.SetState(TopState(robot), v);
    const Vector3d momentum = SpinMomentum(robot, simulator),
                   start = LinkPoses(robot, simulator.q()).back().translation();
    const Eigen::Matrix3d before = LinkPoses(robot, simulator.q()).back().linear();
    const Vector3d velocity = robot.joints[0].rotation * v.head<3>();
    simulator.Step(VectorXd::Zero(6), time);
    const Eigen::Isometry3d pose = LinkPoses(robot, simulator.q()).back();
    if (integrator == Integrator::kLeapfrog) {
      const Vector3d fall(0, 0, -robot.simulation.gravity / 2 * time * time);
      CHECK((pose.translation() - start - velocity * time - fall).norm() < 1e-9);
    }
    const Eigen::Matrix3d expected =
        Eigen::AngleAxisd(time * momentum.norm() / across, momentum.normalized()).matrix() *
        before * Eigen::AngleAxisd(time * (1 - along / across) * 6, Vector3d::UnitZ()).matrix();
    return (pose.linear() - expected).norm();
  };
  CHECK(error(Integrator::kLeapfrog, 1e-4) < 1e-5);
  CHECK(error(Integrator::kLeapfrog, 2e-3) / error(Integrator::kLeapfrog, 1e-3) ==
        Approx(4).margin(0.3));
  CHECK(error(Integrator::kSemiImplicit, 2e-4) / error(Integrator::kSemiImplicit, 1e-4) ==
        Approx(2).margin(0.2));
}

TEST_CASE("energy: leapfrog is of second order with Coriolis terms, semi-implicit of first") {
  RobotDescription robot = Frictionless(LoadExample("double_pendulum"));
  for (JointDescription& joint : robot.joints) joint.dynamics.damping = 0.02;
  for (const auto& [integrator, order] :
       {std::pair{Integrator::kLeapfrog, 2}, {Integrator::kSemiImplicit, 1}}) {
    const auto run = [&](double substep) {
      robot.simulation.integrator = integrator;
      robot.simulation.substep = substep;
      Simulator simulator(robot);
      simulator.SetState(Eigen::Vector2d(2, 1), Eigen::Vector2d(3, -8));
      simulator.Step(Eigen::Vector2d(0.3, -0.1), 0.4);
      Eigen::Vector4d end;
      end << simulator.q(), simulator.v();
      return end;
    };
    const Eigen::Vector4d reference = run(2e-6);
    const double coarse = (run(2e-3) - reference).norm(), fine = (run(1e-3) - reference).norm();
    CHECK(coarse > 1e-6);
    CHECK(std::log2(coarse / fine) == Approx(order).margin(0.12));
  }
}

}  // namespace plumb
