#include "calibrator/motion/csv_log.h"

#include <fmt/format.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <clocale>
#include <cmath>
#include <string>
#include <vector>

#include "sim/simulator.h"
#include "tests/calibrator/fitted_log.h"
#include "tests/calibrator/motion/csv_tables.h"
#include "tests/calibrator/synthetic.h"

namespace plumb {
namespace {

/// Largest difference between what a simulator makes of a log's transitions and what the log says.
double WorstPrediction(const Log& log, const RobotDescription& robot) {
  Simulator simulator(robot);
  Eigen::VectorXd means(robot.parameters.size());
  for (size_t i = 0; i < robot.parameters.size(); ++i) {
    means(static_cast<Eigen::Index>(i)) = robot.parameters[i].mean;
  }
  simulator.SetParameters(means);
  double worst = 0;
  for (const Rollout& rollout : log.rollouts) {
    for (const Transition& t : rollout.transitions) {
      simulator.SetState(t.q, t.v);
      simulator.Step(t.efforts);
      worst = std::max({worst, (simulator.q() - t.next_q).cwiseAbs().maxCoeff(),
                        (simulator.v() - t.next_v).cwiseAbs().maxCoeff()});
    }
  }
  return worst;
}

TEST_CASE(
    "a table recorded in the simulator leads, transition by transition, to the simulator's own "
    "bits") {
  for (const char* name : {"pendulum/gym.toml", "hopper/gym.toml"}) {
    const RobotDescription robot = Robot(name);
    const Log log = ReadTable(SimulatedTable(robot, 3, 40), robot);
    REQUIRE(log.rollouts.size() == 3);
    CHECK(log.drops.total() == 0);
    CHECK(log.warnings.empty());
    for (size_t i = 0; i < 3; ++i) {
      CHECK(log.rollouts[i].episode == static_cast<int64_t>(i));
      // where the last action led is not in the table
      REQUIRE(log.rollouts[i].transitions.size() == 39);
      for (size_t k = 0; k < 39; ++k)
        CHECK(log.rollouts[i].transitions[k].step == static_cast<int>(k));
    }
    const Transition& t = log.rollouts[0].transitions[5];
    REQUIRE(t.efforts.size() == 1);
    CHECK(t.efforts[0].duration == robot.task.period);
    CHECK(t.efforts[0].effort.size() == robot.num_velocities());
    CHECK(t.q == log.rollouts[0].transitions[4].next_q);
    for (const Eigen::VectorXd* sd : {&t.q_sd, &t.v_sd, &t.next_q_sd, &t.next_v_sd}) {
      CHECK(sd->array().isNaN().all());
    }
    CHECK(WorstPrediction(log, robot) == 0);
  }
}

TEST_CASE("a table whose velocities are differences of its positions is told of") {
  RobotDescription robot = Pendulum();
  robot.simulation.latency = 0;
  std::string csv = "t,q/pivot,v/pivot,u/pivot\n";
  double before = 0;
  for (int k = 0; k < 60; ++k) {
    const double q = std::sin(0.1 * k) + 1e-3 * (k * k % 7);  // a motion, and noise
    csv += fmt::format("{},{},{},0\n", k * robot.task.period, q, (q - before) / robot.task.period);
    before = q;
  }
  const Log log = ReadTable(csv, robot);
  CHECK(log.differenced == std::vector<std::string>{"pivot"});
  REQUIRE(log.warnings.size() == 1);
  CHECK_THAT(log.warnings[0], Catch::StartsWith("v/pivot is made of differences"));
}

TEST_CASE("a table without velocities is told what that means, and of no velocities that it has") {
  std::string csv = "t,q/pivot,u/pivot\n";
  for (int k = 0; k < 60; ++k) csv += fmt::format("{},{},0\n", 0.05 * k, std::sin(0.1 * k));
  const Log log = ReadTable(csv);
  CHECK(log.differenced == std::vector<std::string>{"pivot"});
  REQUIRE(log.warnings.size() == 1);
  CHECK_THAT(log.warnings[0], Catch::StartsWith("has no v/ columns: "));
}

TEST_CASE("that actions act late is said where they do") {
  const std::string csv = "t,q/pivot,v/pivot,u/pivot\n0,1,0,0\n0.05,1.1,1,0\n0.1,1.2,2,0\n";
  CHECK(ReadTable(csv).warnings.empty());
  CHECK(ReadTable(csv, Pendulum()).warnings ==
        std::vector<std::string>{"the command of a row acts from 8 ms after it on, as [simulation] "
                                 "latency says"});
}

TEST_CASE("an action acts as late as in the simulator that recorded it") {
  RobotDescription robot = Pendulum();
  REQUIRE(robot.simulation.latency == 0.008);
  const Log log = ReadTable(SimulatedTable(robot, 2, 40), robot);
  const auto& transitions = log.rollouts[1].transitions;
  REQUIRE(transitions[7].efforts.size() == 2);
  CHECK(transitions[7].efforts[0].duration == 0.008);
  CHECK(transitions[7].efforts[0].effort == transitions[6].efforts[1].effort);
  CHECK(transitions[0].efforts[0].effort.isZero());
  CHECK(transitions[7].duration() == Approx(robot.task.period));
  const double worst = WorstPrediction(log, robot);
  CHECK(worst < 1e-3);  // substeps do not begin where the effort changes
  robot.simulation.latency = 0;
  CHECK(WorstPrediction(ReadTable(SimulatedTable(Pendulum(), 2, 40), robot), robot) > 10 * worst);
}

TEST_CASE("columns may be in any order, quoted, with further ones beside them") {
  const Log log = ReadTable(
      "\xef\xbb\xbf\"u/pivot\",\"next \"\"best\"\", or so\",v/pivot,next_v/pivot, q/pivot "
      ",t,next_q/pivot\r\n"
      "# recorded on a Tuesday\r\n"
      "+1,x,0.5,\"0.6\",0.1,0,0.125\r\n"
      "-5,\"a,b\",0.9, 1 ,1e-1,0.4,nan\r\n"
      "\r\n");
  REQUIRE(log.rollouts.size() == 2);
  const Transition& a = log.rollouts[0].transitions[0];
  const Transition& b = log.rollouts[1].transitions[0];
  CHECK(a.q(0) == 0.1);
  CHECK(a.v(0) == 0.5);
  CHECK(a.next_q(0) == 0.125);
  CHECK(a.next_v(0) == 0.6);
  CHECK(a.efforts[0].effort(0) == 1);
  CHECK(a.efforts[0].duration == 0.05);
  CHECK(a.q_sd(0) == 0);
  CHECK(std::isnan(a.next_q_sd(0)));
  CHECK(std::isnan(b.next_q(0)));
  CHECK(b.next_v(0) == 1);
  CHECK(b.efforts[0].effort(0) == -2);  // clipped as the task does
  REQUIRE(log.warnings.size() == 2);
  CHECK(log.warnings[0] == "the same in all rows: q/pivot");
  CHECK(log.warnings[1].find("1 actions go beyond") == 0);
}

TEST_CASE("numbers have a decimal point in every locale") {
  const std::string old = std::setlocale(LC_ALL, nullptr);
  for (const char* locale : {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8"}) {
    if (std::setlocale(LC_ALL, locale)) break;
  }
  CHECK(ReadTable("t,q/pivot,v/pivot,u/pivot\n0,1.5,0,0\n0.05,1.25,0,0\n")
            .rollouts[0]
            .transitions[0]
            .next_q(0) == 1.25);
  std::setlocale(LC_ALL, old.c_str());
}

TEST_CASE("constant signals are worth a warning") {
  const Log log = ReadTable("t,q/pivot,v/pivot,u/pivot\n0,1,0,0\n0.05,1,0,0\n0.1,1,0,0\n");
  CHECK(log.rollouts[0].transitions.size() == 2);
  CHECK(log.warnings == std::vector<std::string>{"the same in all rows: q/pivot, v/pivot"});
}

TEST_CASE("a joint without a motor has no action, and a spherical one a quaternion") {
  RobotDescription robot = Robot("hopper");
  std::string with_root = SimulatedTable(robot, 1, 5);
  with_root.replace(with_root.find("reward"), 6, "u/rootx");
  CHECK(Refusal(with_root, robot) ==
        ":1: column 'u/rootx' is of no joint with a motor of robot 'hopper'; the nearest is "
        "'q/rootx'");

  robot = GymPendulum();
  JointDescription ball = robot.joints[0];
  ball.name = "ball";
  ball.type = JointDescription::Type::kSpherical;
  ball.passive = true;
  robot.joints.push_back(ball);
  robot.task.name = "reach";
  robot.task.target = {0, 1, 0, 0, 0};
  const Log log = ReadTable(
      "t,q/pivot,q/ball/w,q/ball/x,q/ball/y,q/ball/z,v/pivot,v/ball/x,v/ball/y,v/ball/z,u/pivot\n"
      "0,1,0.5,-0.5,0.5,0.5,6,7,8,9,1\n0.05,0,-0.5,0.5,-0.5,-0.5001,0,0,0,0,0\n",
      robot);
  CHECK(log.rollouts[0].transitions[0].q ==
        (Eigen::VectorXd(5) << 1, 0.5, -0.5, 0.5, 0.5).finished());
  // The other quaternion of nearly the same rotation, with few digits.
  const Eigen::VectorXd next = log.rollouts[0].transitions[0].next_q;
  CHECK((next - log.rollouts[0].transitions[0].q + Eigen::VectorXd::Unit(5, 0)).norm() < 2e-4);
  CHECK(std::abs(next.tail<4>().norm() - 1) < 1e-15);
  CHECK(log.rollouts[0].transitions[0].q_sd.size() == 4);
  CHECK(Refusal("t,q/pivot,q/ball/w,q/ball/x,q/ball/y,q/ball/z,v/pivot,v/ball/x,v/ball/y,v/ball/z,"
                "u/pivot\n0,1,1,0,0,0,0,0,0,0,1\n0.05,0,0.5,0.5,0,0,0,0,0,0,0\n",
                robot) == ":3: q of ball (0.5, 0.5, 0, 0) is no unit quaternion");
  CHECK(log.rollouts[0].transitions[0].v == Eigen::Vector4d(6, 7, 8, 9));
  CHECK(log.rollouts[0].transitions[0].efforts[0].effort == Eigen::Vector4d(1, 0, 0, 0));
}

}  // namespace
}  // namespace plumb
