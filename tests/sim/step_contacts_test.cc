#include "sim/step_contacts.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "robot/contact_points.h"
#include "robot/kinematics.h"
#include "tests/sim/robots.h"

namespace plumb {
namespace {

RobotDescription Gym() { return LoadRobot(SourceFile("robots/hopper/gym.toml")); }

// The tree in space over the ground, with a ball at the end of its longer arm, which moves it each
// way.
RobotDescription TreeOverGround() {
  RobotDescription tree = MakeTree();
  tree.simulation = Gym().simulation;
  Shape ball;
  ball.size = {0.05, 0, 0}, ball.position = {0.1, 0.05, 0.2};
  tree.links[3].collisions = {ball};
  return tree;
}

// Jacobian of a contact point's lowest spot, upwards and along the ground, by the kinematics that
// do not know the simulator.
Eigen::MatrixXd JacobianOf(const RobotDescription& robot, size_t point, const Eigen::VectorXd& q,
                           bool planar) {
  Kinematics kinematics(robot);
  kinematics.Update(q, Eigen::VectorXd::Zero(q.size()));
  const ContactPoint sphere = ContactPoints(robot)[point];
  const Eigen::Vector3d down =
      kinematics.link(sphere.link).rotation.transpose() * Eigen::Vector3d(0, 0, -sphere.radius);
  Eigen::Matrix3Xd all(3, q.size());
  kinematics.Jacobian(sphere.link, sphere.centre + down, all);
  Eigen::MatrixXd rows(planar ? 2 : 3, q.size());
  rows.row(0) = all.row(2), rows.row(1) = all.row(0);
  if (!planar) rows.row(2) = all.row(1);
  return rows;
}

struct Step {
  Eigen::VectorXd q, v, next_q, next_v, constrained;
};
// One control step from there.
Step Make(Simulator& simulator, StepContacts* contacts, const Eigen::VectorXd& q,
          const Eigen::VectorXd& v) {
  const Eigen::VectorXd effort = Eigen::VectorXd::Zero(v.size());
  simulator.SetState(q, v);
  contacts->Begin(simulator);
  simulator.Step(effort, 0.008);
  const Eigen::VectorXd free = v + 0.008 * simulator.Acceleration(effort);
  Step step{q, v, simulator.q(), simulator.v(), simulator.v() - free};
  contacts->End(simulator, step.constrained);
  return step;
}

void CheckDynamics(const RobotDescription& robot, size_t point, const Eigen::VectorXd& q,
                   const Eigen::VectorXd& v) {
  const Model model(robot);
  Simulator simulator(robot);
  StepContacts contacts(model, 10);  // all points are near
  const Step step = Make(simulator, &contacts, q, v);
  const StepContacts::Contact& contact = *contacts.touching()[point];
  REQUIRE(contact.ground);
  const bool planar = model.topology().planar;
  const Eigen::Index k = planar ? 2 : 3;
  const Eigen::MatrixXd before = JacobianOf(robot, point, q, planar),
                        after = JacobianOf(robot, point, step.next_q, planar),
                        mobility = after * simulator.MassMatrix().llt().solve(after.transpose());
  CHECK((contact.jacobian - after).norm() < 1e-9);
  CHECK((contact.mobility - mobility).norm() < 1e-9 * mobility.norm());
  // an impulse that changes the point's velocity by u changes the joints' by response u
  CHECK((after * contact.response - Eigen::MatrixXd::Identity(k, k)).norm() < 1e-4);
  CHECK((contact.x.segment(1, k) - before * v).norm() < 1e-9);
  CHECK((contact.x.segment(2 + k, k) - after * step.next_v).norm() < 1e-9);
  CHECK((contact.x.segment(2 + 2 * k, k) - after * step.constrained).norm() < 1e-9);
  CHECK(contact.x[2 + 3 * k] == contact.mobility(0, 0));
  CHECK(contact.x.size() == StepContacts::GroundInputs(model.topology()));
}

}  // namespace

TEST_CASE("a contact is known by its own motion, and answers impulses as the robot does") {
  Eigen::VectorXd q(6), v(6);
  q << 0.1, 1.2, 0.1, -0.3, -0.4, 0.2;
  v << 1, -0.5, 0.3, -2, 1, 4;
  CheckDynamics(Gym(), 0, q, v);
  CheckDynamics(Gym(), 1, q, v);
  const RobotDescription tree = TreeOverGround();
  CheckDynamics(tree, 0, Eigen::Vector4d(0.1, 0.4, -0.3, 0.7), Eigen::Vector4d(0.5, -1, 2, 1));
}

TEST_CASE("a contact touches at the beginning of a step or at its end") {
  const RobotDescription robot = Gym();
  Simulator simulator(robot);
  StepContacts contacts(Model(robot), 0.005);
  Eigen::VectorXd q = Eigen::VectorXd::Zero(6), v = q;
  q[3] = -0.5, q[4] = -1;  // away from stops
  simulator.SetState(q, v);
  Eigen::VectorXd heights;
  Simulator::RowMajorMatrix jacobians;
  simulator.ContactPoints(&heights, &jacobians);
  const double standing = -heights.minCoeff();
  const auto touching = [&](double height, double rising) {
    q[1] = standing + height, v[1] = rising;
    Make(simulator, &contacts, q, v);
    return contacts.touching().size();
  };
  CHECK(touching(0.5, 0) == 0);
  CHECK(touching(0.004, 1) == 1);    // leaves
  CHECK(touching(0.02, -2.5) == 1);  // arrives
  CHECK(touching(0.02, 0) == 0);
}

TEST_CASE("a point that the robot cannot move is none of its contacts") {
  // Below an upright axis a ball turns on the spot.
  RobotDescription turning = TreeOverGround();
  turning.links = {turning.links[0], turning.links[4]};
  turning.joints = {turning.joints[3]};
  JointDescription& joint = turning.joints[0];
  joint.child = 1, joint.axis = Eigen::Vector3d::UnitZ();
  joint.origin.setZero(), joint.rotation.setIdentity();
  Shape ball;
  ball.size = {0.05, 0, 0}, ball.position = {0, 0, 0.05};
  turning.links[1].collisions = {ball};
  Simulator simulator(turning);
  StepContacts contacts(Model(turning), 0.01);
  Make(simulator, &contacts, Eigen::VectorXd::Zero(1), Eigen::VectorXd::Ones(1));
  CHECK(contacts.touching().empty());
  turning.links[1].collisions[0].position.x() = 0.1;  // moves along a circle
  Simulator wheeling(turning);
  StepContacts other(Model(turning), 0.01);
  Make(wheeling, &other, Eigen::VectorXd::Zero(1), Eigen::VectorXd::Ones(1));
  REQUIRE(other.touching().size() == 1);
  CHECK(other.touching()[0]->response.allFinite());
}

TEST_CASE("a joint at a stop is a contact, away from whichever stop is nearer") {
  const RobotDescription robot = Gym();
  Simulator simulator(robot);
  StepContacts contacts(Model(robot), 0.005);
  Eigen::VectorXd q = Eigen::VectorXd::Zero(6), v = q;
  q[1] = 2, q[3] = -0.5;
  const auto check = [&](double angle, double rate, double stop, double away) {
    q[4] = angle, v[4] = rate;
    const Step step = Make(simulator, &contacts, q, v);
    REQUIRE(contacts.touching().size() == 1);
    const StepContacts::Contact& contact = *contacts.touching()[0];
    CHECK_FALSE(contact.ground);
    CHECK(contact.x.size() == StepContacts::kStopInputs);
    CHECK(contact.x[0] == Approx(away * (angle - stop)).margin(1e-12));
    CHECK(contact.x[1] == away * rate);
    CHECK(contact.x[2] == Approx(away * (step.next_q[4] - stop)).margin(1e-12));
    CHECK(contact.x[3] == away * step.next_v[4]);
    CHECK(contact.x[4] == away * step.constrained[4]);
    CHECK(away * contact.response(4, 0) == Approx(1).epsilon(1e-5));
  };
  const JointDescription& knee = robot.joints[4];
  check(knee.upper - 0.002, 1, knee.upper, -1);
  check(knee.lower + 0.001, -1, knee.lower, 1);
}

TEST_CASE("a joint's stop is found behind a spherical joint, whose coordinates are one more") {
  const RobotDescription robot = LoadRobot(SourceFile("robots/quadruped/robot.toml"));
  const Model model(robot);
  Simulator simulator(robot);
  StepContacts contacts(model, 0.005);
  Eigen::VectorXd q = Eigen::VectorXd::Zero(19), v = Eigen::VectorXd::Zero(18);
  q[2] = 2, q[3] = 1;  // in the air
  for (size_t i = 0; i < robot.joints.size(); ++i) {
    const JointDescription& joint = robot.joints[i];
    if (std::isfinite(joint.upper))
      q[model.topology().joints[i].position] = (joint.lower + joint.upper) / 2;
  }
  Make(simulator, &contacts, q, v);
  CHECK(contacts.touching().empty());
  const auto knee = std::find_if(robot.joints.begin(), robot.joints.end(),
                                 [](const auto& joint) { return joint.name == "rear_right_knee"; });
  const auto& place = model.topology().joints[static_cast<size_t>(knee - robot.joints.begin())];
  q[place.position] = knee->lower + 0.001, v[place.velocity] = -0.1;
  Make(simulator, &contacts, q, v);
  REQUIRE(contacts.touching().size() == 1);
  const StepContacts::Contact& stop = *contacts.touching()[0];
  CHECK_FALSE(stop.ground);
  CHECK(stop.x[0] == Approx(0.001));
  CHECK(stop.x[1] == -0.1);
  CHECK(stop.jacobian(0, place.velocity) == 1);
  CHECK(stop.jacobian.cwiseAbs().sum() == 1);
}

}  // namespace plumb
