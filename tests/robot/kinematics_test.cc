#include "robot/kinematics.h"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <stdexcept>

#include "tests/sim/robots.h"

namespace plumb {
namespace {

RobotDescription LoadExample(const std::string& name) {
  return LoadRobot(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/" + name);
}

bool Near(const Eigen::Vector3d& a, const Eigen::Vector3d& b) { return (a - b).norm() < 1e-12; }

}  // namespace

TEST_CASE("poses: the pendulum's rod turns about y") {
  const auto poses = LinkPoses(LoadPendulum("robot.toml"), Eigen::VectorXd::Constant(1, M_PI / 2));
  REQUIRE(poses.size() == 2);
  CHECK(Near(poses[0].position, {0, 0, 0}));
  CHECK(Near(poses[1].position, {0, 0, 1.2}));
  // From upright by a quarter turn about +y: along +x.
  CHECK(Near(poses[1].position + poses[1].rotation * Eigen::Vector3d::UnitZ(), {1, 0, 1.2}));
}

TEST_CASE("poses: the hopper stands, bows, and bends its leg") {
  const RobotDescription hopper = LoadExample("hopper");
  Eigen::VectorXd q(6);
  q << 3, 1.25, 0, 0, 0, 0;
  auto poses = LinkPoses(hopper, q);
  const auto at = [&](const std::string& name) {
    for (size_t i = 0; i < hopper.links.size(); ++i) {
      if (hopper.links[i].name == name) return poses[i];
    }
    throw std::out_of_range(name);
  };
  CHECK(Near(at("torso").position, {3, 0, 1.25}));
  CHECK(Near(at("thigh").position, {3, 0, 1.05}));
  CHECK(Near(at("leg").position, {3, 0, 0.6}));
  CHECK(Near(at("foot").position, {3, 0, 0.1}));

  q[2] = M_PI / 2;   // bows forward: its head to +x, its feet to -x
  q[4] = -M_PI / 2;  // the leg bends backwards: about -y by a negative angle is about +y
  poses = LinkPoses(hopper, q);
  CHECK(Near(at("thigh").position, {2.8, 0, 1.25}));
  CHECK(Near(at("leg").position, {2.35, 0, 1.25}));
  CHECK(Near(at("foot").position, {2.35, 0, 1.75}));
}

TEST_CASE("poses: frames askew, slides, and a spherical joint") {
  RobotDescription tree = MakeTree();
  Eigen::VectorXd q = Eigen::VectorXd::Zero(4);
  q[0] = 2;
  const auto poses = LinkPoses(tree, q);
  const JointDescription& rail = tree.joints[0];
  CHECK(Near(poses[1].position, rail.origin + rail.rotation * rail.axis * 2));
  CHECK((poses[1].rotation - rail.rotation).norm() < 1e-12);
  CHECK(Near(poses[2].position, poses[1].position + poses[1].rotation * tree.joints[1].origin));

  RobotDescription ball = LoadPendulum("robot.toml");
  ball.joints[0].type = JointDescription::Type::kSpherical;
  // A quarter turn about x, not normalised: z goes to -y.
  const auto turned = LinkPoses(ball, Eigen::Vector4d(3, 3, 0, 0));
  CHECK(Near(turned[1].rotation * Eigen::Vector3d::UnitZ(), {0, -1, 0}));
  CHECK_THROWS_AS(LinkPoses(ball, Eigen::VectorXd::Zero(1)), std::invalid_argument);
}

TEST_CASE("kinematics: velocities and Jacobians are the positions' derivatives") {
  RobotDescription tree = MakeTree();
  tree.joints[3].type = JointDescription::Type::kSpherical;
  const Eigen::Vector3d point(0.1, -0.3, 0.2);
  Eigen::VectorXd q(7), v(6);
  q << 0.4, -0.7, 1.1, 0.5, -0.1, 0.7, 0.5;
  v << 0.3, 1.2, -0.8, 0.9, -1.4, 0.6;
  q.tail<4>().normalize();
  // A little earlier or later; a spherical joint turns about axes of its link.
  const auto moved = [&](double t) {
    Eigen::VectorXd at = q;
    at.head<3>() += t * v.head<3>();
    const Eigen::Vector3d turn = t * v.tail<3>();
    const Eigen::Quaterniond to =
        Eigen::Quaterniond(q[3], q[4], q[5], q[6]) *
        Eigen::Quaterniond(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
    at.tail<4>() << to.w(), to.vec();
    return LinkPoses(tree, at);
  };
  const double h = 1e-5;
  const auto before = moved(-h), after = moved(h), now = moved(0);
  Kinematics kinematics(tree);
  kinematics.Update(q, v);
  Eigen::Matrix3Xd jacobian(3, 6);
  for (int link = 0; link < 5; ++link) {
    const auto at = static_cast<size_t>(link);
    const Eigen::Vector3d velocity = (after[at].position + after[at].rotation * point -
                                      before[at].position - before[at].rotation * point) /
                                     (2 * h);
    INFO("link " << link);
    CHECK(Near(kinematics.Position(link, point), now[at].position + now[at].rotation * point));
    CHECK((kinematics.Velocity(link, point) - velocity).norm() < 1e-8);
    kinematics.Jacobian(link, point, jacobian);
    CHECK((jacobian * v - velocity).norm() < 1e-8);
  }
  CHECK_THROWS_AS(kinematics.Update(v, v), std::invalid_argument);
}

}  // namespace plumb
