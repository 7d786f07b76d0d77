// Tables of robots whose drives run a position loop of their own: targets, and positions alone.
#include <fmt/format.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <string>
#include <vector>

#include "sim/simulator.h"
#include "tests/calibrator/motion/csv_tables.h"

namespace plumb {
namespace {

constexpr double kKp = 4, kKd = 0.2, kRest = 0.3;

RobotDescription Held() {
  RobotDescription robot = Robot("pendulum/robot.toml");
  robot.joints[0].dynamics.kp = kKp, robot.joints[0].dynamics.kd = kKd;
  robot.joints[0].dynamics.rest = kRest;
  return robot;
}

double Target(int k) { return 0.4 * std::sin(0.2 * k); }

/// A motion of that robot, told to go to those targets.
std::string Motion(const RobotDescription& robot, int rows, const std::string& columns) {
  Simulator simulator(robot);
  simulator.SetState(Eigen::VectorXd::Zero(1), Eigen::VectorXd::Zero(1));
  std::string csv = "t," + columns + "\n";
  Eigen::VectorXd before = Eigen::VectorXd::Zero(1);
  for (int k = 0; k < rows; ++k) {
    csv += fmt::format("{:.17g}", k * robot.task.period);
    const auto add = [&](const std::string& name, double value) {
      if (columns.find(name) != std::string::npos) csv += fmt::format(",{:.17g}", value);
    };
    add("q/pivot,", simulator.q()[0]), add("v/pivot", simulator.v()[0]);
    add("target_q/pivot", Target(k)), add("kp/pivot", kKp), add("kd/pivot", kKd);
    csv += "\n";
    const Eigen::VectorXd effort = Eigen::VectorXd::Constant(1, kKp * (Target(k) - kRest));
    const double latency = robot.simulation.latency;
    simulator.Step(
        std::vector<EffortSegment>{{latency, before}, {robot.task.period - latency, effort}});
    before = effort;
  }
  return csv;
}

TEST_CASE("a target is an effort on top of the drive's loop: the table leads to the motion") {
  const RobotDescription robot = Held();
  for (const char* columns :
       {"q/pivot,v/pivot,target_q/pivot", "q/pivot,v/pivot,target_q/pivot,kp/pivot,kd/pivot"}) {
    const Log log = ReadTable(Motion(robot, 50, columns), robot);
    REQUIRE(log.rollouts.size() == 1);
    REQUIRE(log.rollouts[0].transitions.size() == 49);
    Simulator simulator(robot);
    for (const Transition& t : log.rollouts[0].transitions) {
      simulator.SetState(t.q, t.v);
      simulator.Step(t.efforts);
      CHECK((simulator.q() - t.next_q).norm() < 1e-12);
      CHECK((simulator.v() - t.next_v).norm() < 1e-12);
    }
  }
}

TEST_CASE("an effort beside a target is added to it, and is clipped alone") {
  const RobotDescription robot = Held();
  const Log log = ReadTable(
      "t,q/pivot,v/pivot,u/pivot,target_q/pivot\n0,0,0,0.5,1\n0.05,0,0,-9,3\n0.1,0,0,0,nan\n"
      "0.15,0,0,0,0\n",
      robot);
  REQUIRE(log.rollouts.size() == 1);
  const auto& transitions = log.rollouts[0].transitions;
  REQUIRE(transitions.size() == 2);  // of what is not known nothing is made
  CHECK(transitions[0].efforts.back().effort[0] == Approx(0.5 + kKp * (1 - kRest)));
  CHECK(transitions[1].efforts.back().effort[0] == Approx(-2 + kKp * (3 - kRest)));
  CHECK(log.drops.not_finite == 1);
}

TEST_CASE("without velocities they are the central differences of the positions") {
  const RobotDescription robot = Held();
  const std::string table = Motion(robot, 50, "q/pivot,target_q/pivot");
  const Log log = ReadTable(table, robot);
  REQUIRE(log.rollouts.size() == 1);
  const auto& transitions = log.rollouts[0].transitions;
  REQUIRE(transitions.size() == 48);  // the first row has no row before it
  for (size_t i = 0; i + 1 < transitions.size(); ++i) {
    const Transition &at = transitions[i], &next = transitions[i + 1];
    CHECK(next.v[0] == Approx((next.next_q[0] - at.q[0]) / (2 * robot.task.period)).epsilon(1e-9));
    CHECK(at.next_v[0] == next.v[0]);
  }
  CHECK(std::isnan(transitions.back().next_v[0]));
  CHECK(log.differenced == std::vector<std::string>{"pivot"});
  CHECK_THAT(Refusal("t,q/pivot,u/pivot,next_q/pivot\n0,0,0,0\n0.05,0,0,0\n", robot),
             Catch::Contains("has no column 'v/pivot'"));
}

TEST_CASE("across a gap and an episode's end nothing is differenced") {
  const RobotDescription robot = Held();
  std::string csv = "t,q/pivot,target_q/pivot,truncated\n";
  for (const int k : {0, 1, 2, 3, 4, 7, 8, 9, 10, 11})
    csv += fmt::format("{},{},0,{:d}\n", 0.05 * k, 0.01 * k * k, k == 9);
  const Log log = ReadTable(csv, robot);
  size_t count = 0;
  for (const Rollout& rollout : log.rollouts) {
    for (const Transition& t : rollout.transitions) {
      ++count;
      const double k = std::sqrt(t.q[0] / 0.01);
      CHECK(t.v[0] == Approx(0.02 * k / 0.05));  // exact of a parabola
      CHECK((k < 3.5 || k > 7.5));
    }
  }
  CHECK(count > 0);
}

TEST_CASE("targets and gains that are not this robot's are refused, with the line") {
  const RobotDescription robot = Held(), loose = Robot("pendulum/robot.toml");
  const std::string row = "\n0,0,0,1";
  CHECK_THAT(Refusal("t,q/pivot,v/pivot,target_q/pivot" + row + "\n", loose),
             Catch::Contains(":1: target_q/pivot: the joint's drive runs no position loop"));
  RobotDescription unsure = robot;
  unsure.parameters.push_back(
      {"rest/pivot", "rad", ParameterDescription::Coordinate::kLinear, 0, 1});
  CHECK_THAT(Refusal("t,q/pivot,v/pivot,target_q/pivot" + row + "\n", unsure),
             Catch::Contains(":1: target_q/pivot: rest/pivot is an uncertain parameter"));
  CHECK_THAT(
      Refusal("t,q/pivot,v/pivot,target_q/pivot,kp/pivot" + row + ",4\n0.05,0,0,1,5\n", robot),
      Catch::Contains(":3: 'kp/pivot' is 5, but 4 in robot.toml's [joint.dynamics]"));
  CHECK_THAT(Refusal("t,q/pivot,v/pivot,target_q/pivot" + row + "\n0.05,0,0,1e150\n", robot),
             Catch::Contains(":3: 'target_q/pivot' is 1e+150"));
  CHECK_THAT(Refusal("t,q/pivot,v/pivot,target_q/pivott" + row + "\n", robot),
             Catch::Contains("'target_q/pivott' is of no joint with a motor"));
  CHECK_THAT(Refusal("t,q/pivot,v/pivot" + std::string("\n0,0,0\n"), robot),
             Catch::Contains("has no column 'u/pivot'"));
  // of two drives, one of which has a target
  RobotDescription two = Robot("double_pendulum/robot.toml");
  for (JointDescription& joint : two.joints) joint.dynamics.kp = kKp;
  const std::string &a = two.joints[0].name, &b = two.joints[1].name;
  CHECK_THAT(Refusal(fmt::format("t,q/{0},q/{1},target_q/{0}\n0,0,0,0\n", a, b), two),
             Catch::Contains(fmt::format("has no column 'target_q/{}'", b)));
}

}  // namespace
}  // namespace plumb
