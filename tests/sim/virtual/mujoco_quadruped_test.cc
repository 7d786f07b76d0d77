// A floating base with four legs in MuJoCo and in the simulator: the same motion in flight, and the
// same standing, although their contacts have nothing in common.

#include <catch2/catch.hpp>
#include <cmath>

#include "robot/contact_points.h"
#include "robot/kinematics.h"
#include "sim/simulator.h"
#include "sim/virtual/mujoco_backend.h"
#include "tests/sim/robots.h"

namespace plumb {
namespace {

using Eigen::VectorXd;

/// With the parameters as the prior has them, and nothing but smooth forces.
RobotDescription Quadruped() {
  RobotDescription robot = LoadRobot(SourceFile("robots/quadruped"));
  robot.parameters.clear();
  for (JointDescription& joint : robot.joints) joint.dynamics.friction = 0;
  return robot;
}

VectorXd Stance(const RobotDescription& robot, double height) {
  VectorXd q = VectorXd::Zero(robot.num_positions());
  q[2] = height, q[3] = 1;
  for (Eigen::Index i = 0; i < 12; ++i)
    q[7 + i] = robot.joints[static_cast<size_t>(4 + i)].dynamics.rest;
  return q;
}

double HeightAboveFeet(const RobotDescription& robot, const VectorXd& q) {
  const std::vector<Pose> poses = LinkPoses(robot, q);
  double sum = 0;
  int feet = 0;
  for (const ContactPoint& point : ContactPoints(robot)) {
    if (point.radius == 0) continue;  // the trunk's corners
    const Pose& pose = poses[static_cast<size_t>(point.link)];
    sum += q[2] - (pose.position + pose.rotation * point.centre).z(), ++feet;
  }
  return sum / feet;
}

/// Both begin there, at rest, and are left alone for so long [s].
void Settle(const VectorXd& q, double duration, PhysicsBackend* engine, Simulator* simulator) {
  const VectorXd none = VectorXd::Zero(18);
  engine->SetState(q, none);
  simulator->SetState(q, none);
  for (double t = 0; t < duration - 1e-9; t += 0.02) {
    REQUIRE(engine->Advance(none, 0.02));
    simulator->Step(none, 0.02);
  }
}

}  // namespace

TEST_CASE("quadruped: in flight it moves as in MuJoCo") {
  RobotDescription robot = Quadruped();
  const auto engine = MakeMujocoBackend(robot);
  robot.simulation.integrator = SimulationSettings::Integrator::kLeapfrog;
  robot.simulation.substep = 2e-5;
  Simulator simulator(robot);
  VectorXd q = Stance(robot, 5), v(18), effort = VectorXd::Zero(18);
  q.segment<4>(3) = Eigen::Vector4d(0.8, 0.3, -0.4, 0.2).normalized();
  for (Eigen::Index i = 0; i < 18; ++i) v[i] = 1.5 * std::sin(1.7 * static_cast<double>(i));
  for (Eigen::Index i = 6; i < 18; ++i) effort[i] = std::cos(2.3 * static_cast<double>(i));
  engine->SetState(q, v);
  simulator.SetState(q, v);
  for (int i = 0; i < 200; ++i) REQUIRE(engine->Advance(effort, 5e-4));
  simulator.Step(effort, 0.1);
  CHECK((simulator.v() - v).norm() > 3);  // something has happened
  CHECK((engine->q() - simulator.q()).norm() < 1e-6);
  CHECK((engine->v() - simulator.v()).norm() < 1e-5);
}

TEST_CASE("quadruped: it comes to stand where it does in MuJoCo") {
  RobotDescription robot = Quadruped();
  robot.simulation.contact->friction = 1e-3;  // or it depended on how it came there
  // On such ice leapfrog substeps glide on, by 6 mm/s.
  robot.simulation.integrator = SimulationSettings::Integrator::kSemiImplicit;
  const auto engine = MakeMujocoBackend(robot);
  Simulator simulator(robot);
  Settle(Stance(robot, 0.335), 10, engine.get(), &simulator);
  CHECK(simulator.v().norm() < 1e-3);
  CHECK(engine->v().norm() < 1e-3);
  // The legs' springs carry the same weight: what they make is the same.
  for (Eigen::Index i = 7; i < 19; ++i) {
    INFO(robot.joints[static_cast<size_t>(i - 3)].name);
    CHECK(simulator.q()[i] == Approx(engine->q()[i]).margin(0.002));
  }
  // The trunk is as high above its feet, which sink in by what their grounds give way.
  CHECK(HeightAboveFeet(robot, simulator.q()) ==
        Approx(HeightAboveFeet(robot, engine->q())).margin(0.001));
}

TEST_CASE("quadruped: with its trunk on a table and its feet against each other, as in MuJoCo") {
  RobotDescription robot = Quadruped();  // with friction, or the feet slid past each other
  Shape table{.type = Shape::Type::kBox, .size = {0.3, 0.08, 0.6}};
  table.position.z() = 0.3;
  robot.links[0].collisions = {table};
  robot.simulation.link_pairs = {{"world", "trunk"},
                                 {"front_left_calf", "front_right_calf"},
                                 {"rear_left_calf", "rear_right_calf"}};
  for (JointDescription& joint : robot.joints) {
    if (!joint.name.ends_with("_hip")) continue;
    joint.dynamics.rest = joint.name.find("left") != std::string::npos ? -0.6 : 0.6;
  }
  const auto engine = MakeMujocoBackend(robot);
  Simulator simulator(robot);
  VectorXd q = Stance(robot, 0.67);
  for (Eigen::Index leg = 7; leg < 19; leg += 3) q[leg] = q[leg] < 0 ? -0.37 : 0.37;  // apart
  Settle(q, 2, engine.get(), &simulator);
  CHECK(simulator.v().norm() < 1e-3);
  // The table's and half the trunk's height, less what four corners are pressed in.
  double mass = 0;
  for (const LinkDescription& link : robot.links) mass += link.mass;
  const double depth = mass * robot.simulation.gravity / (4 * robot.simulation.contact->stiffness);
  CHECK(simulator.q()[2] == Approx(0.657 - depth).margin(2e-4));
  CHECK(engine->q()[2] == Approx(0.657).margin(0.0011));  // its contacts begin a millimetre apart
  for (Eigen::Index i = 7; i < 19; ++i) {
    const JointDescription& joint = robot.joints[static_cast<size_t>(i - 3)];
    INFO(joint.name << " rests at " << joint.dynamics.rest);
    CHECK(simulator.q()[i] == Approx(engine->q()[i]).margin(0.005));
    if (joint.name.ends_with("_hip"))
      CHECK(std::abs(simulator.q()[i]) < 0.5);  // they are in the way
  }
}

}  // namespace plumb
