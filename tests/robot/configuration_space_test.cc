#include "robot/configuration_space.h"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>

#include "common/random.h"
#include "robot/kinematics.h"
#include "robot/placement.h"
#include "tests/sim/robots.h"

namespace plumb {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;
using Eigen::VectorXd;

RobotDescription Quadruped() { return LoadRobot(SourceFile("robots/quadruped")); }

// x, y, z, the trunk's quaternion, twelve joints.
VectorXd At(const Quaterniond& turn) {
  VectorXd q = VectorXd::LinSpaced(19, 0.1, 1.9);
  q.segment<4>(3) << turn.w(), turn.x(), turn.y(), turn.z();
  return q;
}

Quaterniond AnyTurn(Random& random) {
  return Quaterniond(random.Normal(), random.Normal(), random.Normal(), random.Normal())
      .normalized();
}

TEST_CASE("of a robot with one coordinate a joint q is a list of numbers, to the bit") {
  const ConfigurationSpace space(LoadPendulum("robot.toml"));
  CHECK(space.flat());
  const VectorXd a = VectorXd::Constant(1, 0.1), b = VectorXd::Constant(1, 7.3);
  CHECK(space.Difference(a, b) == a - b);
  CHECK(space.Difference(a, b, 0) == a[0] - b[0]);
  CHECK(space.Move(a, b) == a + b);
  CHECK(space.Coordinates(a, b) == a);
  CHECK(space.At(a, b) == a);
}

TEST_CASE("a step of a rotation is about the link's axes, a difference undoes it") {
  const ConfigurationSpace space(Quadruped());
  CHECK_FALSE(space.flat());
  REQUIRE(space.num_positions() == 19);
  REQUIRE(space.num_velocities() == 18);
  Random random(1, {2});
  for (const double size : {0.0, 1e-12, 1e-6, 0.3, 3.0}) {
    const Quaterniond turn = AnyTurn(random);
    const VectorXd q = At(turn);
    VectorXd step = VectorXd::LinSpaced(18, -1, 1);
    const Vector3d axis = Vector3d(1, -2, 2) / 3;
    step.segment<3>(3) = size * axis;
    const VectorXd moved = space.Move(q, step);
    INFO(size);
    CHECK((space.Difference(moved, q) - step).norm() < 1e-12);
    CHECK((space.At(space.Coordinates(moved, q), q) - moved).norm() < 1e-12);
    for (Eigen::Index c = 0; c < 18; ++c)
      CHECK(space.Difference(moved, q, c) == space.Difference(moved, q)[c]);
    // Turned about the axis as its own link has it: the axis itself stays where it was.
    const Quaterniond after(moved[3], moved[4], moved[5], moved[6]);
    CHECK((after * axis - turn * axis).norm() < 1e-12);
    CHECK(after.angularDistance(turn) == Approx(size).margin(1e-7));
  }
}

TEST_CASE("a step in one entry is what the velocity of that entry does in a moment") {
  const RobotDescription robot = Quadruped();
  const ConfigurationSpace space(robot);
  Kinematics kinematics(robot);
  Random random(3, {2});
  const VectorXd q = At(AnyTurn(random));
  const int foot = static_cast<int>(robot.links.size()) - 1;
  const Vector3d point(0, 0, -0.2);
  constexpr double kMoment = 1e-6;
  for (Eigen::Index c = 0; c < 18; ++c) {
    VectorXd before = q, after = q;
    space.Move(c, -kMoment / 2, before);
    space.Move(c, kMoment / 2, after);
    kinematics.Update(after, VectorXd::Zero(18));
    Vector3d velocity = kinematics.Position(foot, point);
    kinematics.Update(before, VectorXd::Zero(18));
    velocity = (velocity - kinematics.Position(foot, point)) / kMoment;
    kinematics.Update(q, VectorXd::Unit(18, c));
    INFO(c);
    CHECK((velocity - kinematics.Velocity(foot, point)).norm() < 1e-8);
  }
}

TEST_CASE("both quaternions of a rotation are one and the same") {
  const ConfigurationSpace space(Quadruped());
  Random random(4, {2});
  const Quaterniond turn = AnyTurn(random);
  VectorXd q = At(turn), other = q;
  other.segment<4>(3) *= -1;
  CHECK(space.Difference(q, other).norm() == 0);
  CHECK(space.Normalise(q, other).empty());
  CHECK((other - q).norm() < 1e-15);
}

TEST_CASE("what is no unit quaternion is told of by its joint's name") {
  const ConfigurationSpace space(Quadruped());
  VectorXd q = At(Quaterniond::Identity());
  CHECK(space.Has(q));
  q.segment<4>(3) *= 1 + 9e-7;
  CHECK(space.Has(q));
  q.segment<4>(3) *= 1 + 3e-7;
  CHECK_FALSE(space.Has(q));
  // Written with four digits it is meant as one all the same.
  CHECK(space.Normalise(q, q).empty());
  CHECK(space.Has(q));
  q.segment<4>(3) << 0.5, 0.5, 0, 0;
  CHECK(space.Fault(q) == "of base/rotation (0.5, 0.5, 0, 0) is no unit quaternion");
  CHECK(space.Normalise(q, q) == space.Fault(q));
  q.segment<4>(3) << 1, 0, 0, 0;
  q[0] = INFINITY;
  CHECK(space.Fault(q) == "is not finite");
  q[3] = NAN;
  CHECK(space.Fault(q) == "of base/rotation (nan, 0, 0, 0) is no unit quaternion");
  CHECK(space.Normalise(q, q).empty());  // not observed
  CHECK(space.Fault(VectorXd::Zero(18)) == "has 18 entries, not 19");
}

TEST_CASE("where a robot is to be put: along the ground and heading do not count, lean does") {
  const Placement placement(Quadruped());
  const VectorXd wanted = At(Quaterniond::Identity());
  VectorXd q = At(Quaterniond(Eigen::AngleAxisd(2, Vector3d::UnitZ())));
  q[0] += 3, q[1] -= 4;
  CHECK(placement.Distance(q, wanted).norm() < 1e-12);
  q[2] += 0.2;
  q[18] -= 0.3;
  const VectorXd distance = placement.Distance(q, wanted);
  CHECK(distance[2] == Approx(0.2));
  CHECK(distance[17] == Approx(-0.3));
  CHECK(placement.name(2) == "base/z");
  CHECK(placement.name(5) == "base/rotation/z");
  q = At(Quaterniond(Eigen::AngleAxisd(2, Vector3d::UnitZ())) *
         Quaterniond(Eigen::AngleAxisd(0.4, Vector3d::UnitX())));
  CHECK(placement.Distance(q, wanted).norm() == Approx(0.4));
  CHECK(placement.Distance(q, wanted)[3] == Approx(0.4));
}

TEST_CASE("where all that moves is measured, all of it counts") {
  const Placement placement(LoadRobot(SourceFile("robots/hopper/free.toml")));
  const VectorXd wanted = VectorXd::Zero(6), q = VectorXd::LinSpaced(6, 0.1, 0.6);
  CHECK(placement.Distance(q, wanted) == q);
}

}  // namespace
}  // namespace plumb
