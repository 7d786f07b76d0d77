// Links that touch each other, and what the base carries: steps and slopes.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "robot/contact_pairs.h"
#include "robot/contact_points.h"
#include "sim/simulator.h"
#include "tests/sim/trees.h"

namespace plumb {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kGravity = 9.81, kStiffness = 5000;

Shape Sphere(double radius) { return {.size = Vector3d(radius, 0, 0)}; }
Shape Box(const Vector3d& size) { return {.type = Shape::Type::kBox, .size = size}; }
Shape Capsule(double radius, double length) {
  return {.type = Shape::Type::kCapsule, .size = Vector3d(radius, length, 0)};
}

// Bodies of 2 kg that float, one of each shape, in a world that has shapes, too.
RobotDescription Bodies(const std::vector<Shape>& world, const std::vector<Shape>& shapes,
                        double gravity = kGravity) {
  std::string urdf = "<robot name='bodies'><link name='world'/>";
  for (size_t i = 0; i < shapes.size(); ++i) {
    const std::string name = "body" + std::to_string(i);
    urdf += "<link name='" + name +
            "'><inertial><mass value='2'/><inertia ixx='.05' iyy='.05' izz='.05' ixy='0' ixz='0' "
            "iyz='0'/></inertial></link><joint name='" +
            name + "_base' type='floating'><parent link='world'/><child link='" + name +
            "'/></joint>";
  }
  RobotDescription robot = FromUrdf(urdf + "</robot>");
  robot.simulation.gravity = gravity;
  robot.simulation.substep = 0.001;
  robot.simulation.contact = {
      .stiffness = kStiffness, .damping = 150, .friction = 0.5, .slip_speed = 0.01};
  robot.links[0].collisions = world;
  for (LinkDescription& link : robot.links) {
    for (size_t i = 0; i < shapes.size(); ++i) {
      if (link.name == "body" + std::to_string(i)) link.collisions = {shapes[i]};
    }
  }
  robot.simulation.link_pairs = {{"*", "body*"}};
  return robot;
}

VectorXd At(const std::vector<Vector3d>& positions) {
  VectorXd q = VectorXd::Zero(7 * static_cast<Eigen::Index>(positions.size()));
  for (size_t i = 0; i < positions.size(); ++i) {
    q.segment<3>(7 * static_cast<Eigen::Index>(i)) = positions[i];
    q[7 * static_cast<Eigen::Index>(i) + 3] = 1;
  }
  return q;
}

void Run(Simulator& simulator, double duration) {
  simulator.Step(VectorXd::Zero(simulator.num_velocities()), duration);
}

// A table whose top is 1 m above the ground.
Shape Table() {
  Shape table = Box({1, 1, 0.2});
  table.position.z() = 0.9;
  return table;
}

}  // namespace

TEST_CASE("link contact: what the base carries holds what lies on it") {
  const auto [shape, reach, spots] =
      GENERATE(table<Shape, double, int>({{Sphere(0.1), 0.1, 1}, {Box({0.2, 0.4, 0.3}), 0.15, 4}}));
  Simulator simulator(Bodies({Table()}, {shape}));
  simulator.SetState(At({{0.1, 0.2, 1.3}}), VectorXd::Zero(6));
  Run(simulator, 0.1);
  CHECK(simulator.v()[2] == Approx(-0.1 * kGravity));
  Run(simulator, 3);
  CHECK(simulator.v().norm() < 1e-6);
  CHECK(simulator.q()[2] == Approx(1 + reach - 2 * kGravity / (spots * kStiffness)).margin(1e-9));
  CHECK(simulator.q()[0] == Approx(0.1).margin(1e-6));
}

TEST_CASE("link contact: a robot with known parameters touches where it did") {
  Shape mesh{.type = Shape::Type::kMesh};
  mesh.corners = {{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}, {0, 0, 0.1}};
  RobotDescription robot =
      Bodies({Table()}, {Box({0.1, 0.2, 0.3}), Capsule(0.1, 0.2), Sphere(0.1), mesh});
  robot.links[8].collisions.push_back(mesh);
  const RobotDescription known = Model(robot).Describe(VectorXd());
  const ContactPairs was = FindContactPairs(robot), is = FindContactPairs(known);
  CHECK(was.pairs.size() == 6);
  CHECK(is.pairs == was.pairs);
  const std::vector<ContactPoint> before = ContactPoints(robot), after = ContactPoints(known);
  REQUIRE(before.size() == 8 + 2 + 4 + 1 + 4);
  REQUIRE(after.size() == before.size());
  for (size_t i = 0; i < before.size(); ++i) {
    CHECK((after[i].centre - before[i].centre).norm() < 1e-15);
    CHECK(after[i].radius == before[i].radius);
  }
  CHECK(Model(known).topology().pairs.size() == was.pairs.size());
  robot.simulation.contact.reset();
  CHECK(FindContactPairs(robot).pairs.empty());
}

TEST_CASE("link contact: a rod comes to lie on a box, held at both ends") {
  Simulator simulator(Bodies({Table()}, {Capsule(0.1, 0.4)}));
  VectorXd q = At({{0, 0, 1.3}});
  q.segment<4>(3) << std::sqrt(0.5), 0, std::sqrt(0.5), 0;
  simulator.SetState(q, VectorXd::Zero(6));
  Run(simulator, 3);
  CHECK(simulator.v().norm() < 1e-6);
  CHECK(simulator.q()[2] == Approx(1.1 - 2 * kGravity / (2 * kStiffness)).margin(1e-7));
}

TEST_CASE("link contact: boxes stand on each other") {
  const Shape box = Box({0.3, 0.3, 0.2});
  Simulator simulator(Bodies({Table()}, {box, box, box}));
  simulator.SetState(At({{0, 0, 1.1}, {0.02, 0, 1.301}, {0, 0.03, 1.502}}), VectorXd::Zero(18));
  Run(simulator, 4);
  CHECK(simulator.v().norm() < 1e-3);                  // friction is viscous below the slip speed
  const double one = 2 * kGravity / (4 * kStiffness);  // pressed in by one body
  CHECK(simulator.q()[2] == Approx(1.1 - 3 * one).margin(2e-4));
  CHECK(simulator.q()[9] == Approx(1.3 - 5 * one).margin(4e-4));
  CHECK(simulator.q()[16] == Approx(1.5 - 6 * one).margin(6e-4));
}

TEST_CASE("link contact: on a slope a box slides as Coulomb says, or stays") {
  const double degrees = GENERATE(20.0, 35.0);
  const double slope = degrees * M_PI / 180, friction = 0.5;
  Shape hill = Box({40, 2, 1});
  hill.rotation = Eigen::AngleAxisd(-slope, Vector3d::UnitY()).toRotationMatrix();
  RobotDescription robot = Bodies({hill}, {Box({0.4, 0.4, 0.1})});
  robot.simulation.contact->slip_speed = 1e-4;
  Simulator simulator(robot);
  VectorXd q = At({hill.rotation * Vector3d(0, 0, 0.55) + Vector3d(0, 0, 20)});
  q.head<3>() -= Vector3d(0, 0, 20);
  q.segment<4>(3) << std::cos(slope / 2), 0, -std::sin(slope / 2), 0;
  simulator.SetState(q, VectorXd::Zero(6));
  Run(simulator, 0.5);
  const double before = simulator.v().head<3>().norm();
  Run(simulator, 0.2);
  const double acceleration = (simulator.v().head<3>().norm() - before) / 0.2;
  const double expected = kGravity * (std::sin(slope) - friction * std::cos(slope));
  INFO(degrees << " degrees");
  if (expected < 0) {
    CHECK(simulator.v().norm() < 1e-3);
  } else {
    CHECK(acceleration == Approx(expected).epsilon(0.01));
  }
}

TEST_CASE("link contact: bodies that meet keep their momentum, and gain no energy") {
  Random random(9);
  int met = 0;
  for (int i = 0; i < 30; ++i) {
    const std::vector<Shape> kinds{Sphere(0.15), Capsule(0.08, 0.3), Box({0.2, 0.3, 0.25})};
    Simulator simulator(
        Bodies({}, {kinds[static_cast<size_t>(i) % 3], kinds[static_cast<size_t>(i) / 3 % 3]}, 0));
    VectorXd q = At({{-0.4, 0, 1}, {0.4, random.Uniform(-0.1, 0.1), 1}});
    for (const Eigen::Index at : {3, 10}) q.segment<4>(at) += 0.5 * DrawNumbers(4, random, 1);
    for (const Eigen::Index at : {3, 10}) q.segment<4>(at).normalize();
    VectorXd v = VectorXd::Zero(12);
    v[0] = 1, v[6] = -1.5;
    v.segment<3>(3) = DrawVector(random, 1);
    simulator.SetState(q, v);
    const auto momentum = [&] {
      return Vector3d(2 * (simulator.v().head<3>() + simulator.v().segment<3>(6)));
    };
    const auto energy = [&] {
      return 0.5 * simulator.v().dot(simulator.MassMatrix() * simulator.v());
    };
    const Vector3d first = momentum();
    double most = energy();
    Run(simulator, 1);
    INFO(i);
    CHECK((momentum() - first).norm() < 1e-9);
    CHECK(energy() < most + 1e-9);
    met += std::abs(simulator.v()[0] - 1) > 0.1;
  }
  CHECK(met >= 25);
}

TEST_CASE("link contact: two legs on one trunk push each other, and the trunk stays") {
  // Arms that hang from one slide, driven against each other: what the one feels the other does.
  RobotDescription robot = FromUrdf(
      "<robot name='scissors'><link name='base'/>"
      "<link name='trunk'><inertial><mass value='3'/><inertia ixx='.1' iyy='.1' izz='.1' ixy='0' "
      "ixz='0' iyz='0'/></inertial></link>"
      "<link name='left'><inertial><origin xyz='0 0 -.2'/><mass value='1'/><inertia ixx='.02' "
      "iyy='.02' izz='.02' ixy='0' ixz='0' iyz='0'/></inertial><collision><origin xyz='0 0 -.2'/>"
      "<geometry><capsule radius='.03' length='.4'/></geometry></collision></link>"
      "<link name='right'><inertial><origin xyz='0 0 -.2'/><mass value='1'/><inertia ixx='.02' "
      "iyy='.02' izz='.02' ixy='0' ixz='0' iyz='0'/></inertial><collision><origin xyz='0 0 -.2'/>"
      "<geometry><capsule radius='.03' length='.4'/></geometry></collision></link>"
      "<joint name='slide' type='prismatic'><parent link='base'/><child link='trunk'/><origin "
      "xyz='0 0 1'/><axis "
      "xyz='0 1 0'/><limit lower='-9' upper='9' effort='0' velocity='9'/></joint>"
      "<joint name='l' type='revolute'><parent link='trunk'/><child link='left'/><origin xyz='0 .1 "
      "0'/><axis xyz='1 0 0'/><limit lower='-9' upper='9' effort='20' velocity='9'/></joint>"
      "<joint name='r' type='revolute'><parent link='trunk'/><child link='right'/><origin xyz='0 "
      "-.1 0'/><axis xyz='1 0 0'/><limit lower='-9' upper='9' effort='20' velocity='9'/></joint>"
      "</robot>");
  robot.simulation.gravity = kGravity;
  robot.simulation.substep = 0.001;
  robot.simulation.contact = {
      .stiffness = kStiffness, .damping = 150, .friction = 0.5, .slip_speed = 0.01};
  for (JointDescription& joint : robot.joints) joint.dynamics.damping = 2;
  robot.simulation.link_pairs = {{"left", "right"}};
  Simulator simulator(robot);
  simulator.SetState(VectorXd::Zero(3), VectorXd::Zero(3));
  const VectorXd efforts = (VectorXd(3) << 0, -2, 2).finished();
  simulator.Step(efforts, 4);
  INFO(simulator.q().transpose());
  CHECK(simulator.v().norm() < 1e-4);
  CHECK(simulator.q()[1] == Approx(-simulator.q()[2]).margin(1e-6));
  CHECK(std::abs(simulator.q()[0]) < 1e-6);
  // They touch at their ends, before they are where gravity would hold them.
  const double angle = -simulator.q()[1], gap = 0.2 - 2 * 0.4 * std::sin(angle);
  const double force = (2 - 1 * kGravity * 0.2 * std::sin(angle)) / (0.4 * std::cos(angle));
  CHECK(gap == Approx(0.06 - force / kStiffness).margin(1e-4));
}

}  // namespace plumb
