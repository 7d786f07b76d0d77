#include "sim/tasks/walk.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "robot/contact_points.h"
#include "robot/kinematics.h"
#include "tests/sim/robots.h"

namespace plumb {
namespace {

struct WalkState {
  Eigen::VectorXd q = Eigen::VectorXd::Zero(19), v = Eigen::VectorXd::Zero(18);
};

/// With its legs at rest, level, headed by `heading`, moving in that heading.
WalkState Going(const RobotDescription& robot, double heading, double forward, double left) {
  WalkState state;
  state.q.head<7>() << 3, -2, 0.33, std::cos(heading / 2), 0, 0, std::sin(heading / 2);
  for (Eigen::Index i = 0; i < 12; ++i)
    state.q[7 + i] = robot.joints[static_cast<size_t>(4 + i)].dynamics.rest;
  state.v[0] = forward * std::cos(heading) - left * std::sin(heading);
  state.v[1] = forward * std::sin(heading) + left * std::cos(heading);
  return state;
}

}  // namespace

TEST_CASE("walk: who goes as commanded earns one and a half, in whatever heading") {
  const RobotDescription robot = LoadRobot(SourceFile("robots/quadruped"));
  const auto task = MakeTask(robot);
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(18);
  for (const double heading : {0.0, 1.0, -2.5}) {
    const WalkState right = Going(robot, heading, 0.5, 0);
    CHECK(task->Reward(right.q, right.v, none, right.q, right.v) == Approx(1.5).epsilon(1e-12));
    const WalkState off = Going(robot, heading, 0.2, -0.4);  // by half a metre a second
    CHECK(task->Reward(off.q, off.v, none, off.q, off.v) ==
          Approx(std::exp(-1) + 0.5).epsilon(1e-12));
    WalkState turning = right;
    turning.v[5] = 0.5;
    CHECK(task->Reward(right.q, turning.v, none, right.q, turning.v) ==
          Approx(1 + 0.5 * std::exp(-1)).epsilon(1e-12));
  }
}

TEST_CASE("walk: a drive's torque is the effort and its spring's") {
  const RobotDescription robot = LoadRobot(SourceFile("robots/quadruped"));
  const auto task = MakeTask(robot);
  const WalkState going = Going(robot, 0, 0.5, 0);
  WalkState bent = going;
  bent.q[7 + 4] += 0.2;
  Eigen::VectorXd effort = Eigen::VectorXd::Zero(18);
  effort[6 + 4] = robot.joints[8].dynamics.kp * 0.2;  // which holds it there: no torque
  const double rest = 0.1 * 0.2 * 0.2 / 12;
  CHECK(task->Reward(bent.q, bent.v, Eigen::VectorXd::Zero(18), bent.q, bent.v) ==
        Approx(1.5 - rest - 2e-4 * 25).epsilon(1e-12));
  CHECK(task->Reward(bent.q, bent.v, effort, bent.q, bent.v) == Approx(1.5 - rest).epsilon(1e-12));
}

TEST_CASE("walk: what is seen does not depend on place and heading") {
  const RobotDescription robot = LoadRobot(SourceFile("robots/quadruped"));
  const auto task = MakeTask(robot);
  const auto seen = [&](double heading) {
    std::vector<float> observation(static_cast<size_t>(task->observation_size()));
    const WalkState state = Going(robot, heading, 0.5, 0.1);
    task->Observe(state.q, state.v, observation);
    return observation;
  };
  const std::vector<float> one = seen(0), other = seen(2);
  REQUIRE(one.size() == 34);
  for (size_t i = 0; i < one.size(); ++i) CHECK(one[i] == Approx(other[i]).margin(1e-6));
  CHECK(one[2] == -1);           // gravity is below
  CHECK(one[3] == Approx(0.5));  // forward
  CHECK(one[4] == Approx(0.1));  // to the left
}

TEST_CASE("walk: an episode begins on the feet, and ends with a fall") {
  const RobotDescription robot = LoadRobot(SourceFile("robots/quadruped"));
  const auto task = MakeTask(robot);
  Random random(3);
  WalkState start;
  double lowest = 0;
  const int times = 200;
  for (int i = 0; i < times; ++i) {
    task->InitialState(random, start.q, start.v);
    CHECK_FALSE(task->Terminated(start.q, start.v));
    const std::vector<Pose> poses = LinkPoses(robot, start.q);
    for (const ContactPoint& point : ContactPoints(robot)) {
      const Pose& pose = poses[static_cast<size_t>(point.link)];
      if (point.radius == 0) continue;
      lowest += ((pose.position + pose.rotation * point.centre).z() - point.radius) / (4 * times);
    }
  }
  CHECK(lowest == Approx(0).margin(0.01));
  WalkState lying = Going(robot, 0, 0, 0);
  lying.q[2] = 0.1;
  CHECK(task->Terminated(lying.q, lying.v));
  CHECK(task->Reward(lying.q, lying.v, Eigen::VectorXd::Zero(18), lying.q, lying.v) == 0);
  WalkState leaning = Going(robot, 0, 0, 0);
  leaning.q.segment<4>(3) << std::cos(0.55), std::sin(0.55), 0, 0;  // 63 degrees
  CHECK(task->Terminated(leaning.q, leaning.v));
  leaning.q.segment<4>(3) << std::cos(0.5), std::sin(0.5), 0, 0;
  CHECK_FALSE(task->Terminated(leaning.q, leaning.v));
  lying.q[2] = std::nan("");
  CHECK(task->Terminated(lying.q, lying.v));
}

TEST_CASE("stand: is paid as walking nowhere, and begins above the ground, askew") {
  RobotDescription robot = LoadRobot(SourceFile("robots/quadruped"));
  robot.task.name = "stand";
  CHECK_THROWS_WITH(MakeTask(robot), Catch::Contains("velocity is for 'walk'"));
  robot.task.velocity = {0, 0, 0};
  const auto stand = MakeTask(robot);
  robot.task.name = "walk";
  const auto walk = MakeTask(robot);
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(18);
  const WalkState still = Going(robot, 0.3, 0, 0), going = Going(robot, 0.3, 0.2, 0.1);
  CHECK(stand->Reward(still.q, still.v, none, still.q, still.v) == Approx(1.5).epsilon(1e-12));
  CHECK(stand->Reward(still.q, still.v, none, going.q, going.v) ==
        walk->Reward(still.q, still.v, none, going.q, going.v));
  Random random(3);
  WalkState start;
  double most = 0, highest = 0;
  for (int i = 0; i < 200; ++i) {
    stand->InitialState(random, start.q, start.v);
    CHECK_FALSE(stand->Terminated(start.q, start.v));
    CHECK(start.q.segment<4>(3).norm() == Approx(1).epsilon(1e-12));
    const Eigen::Quaterniond trunk(start.q[3], start.q[4], start.q[5], start.q[6]);
    most = std::max(most, std::acos((trunk * Eigen::Vector3d::UnitZ()).z()));
    double lowest = 1;
    const std::vector<Pose> poses = LinkPoses(robot, start.q);
    for (const ContactPoint& point : ContactPoints(robot)) {
      const Pose& pose = poses[static_cast<size_t>(point.link)];
      lowest = std::min(lowest, (pose.position + pose.rotation * point.centre).z() - point.radius);
    }
    CHECK(lowest > -0.03);
    highest = std::max(highest, lowest);
  }
  CHECK((most > 0.1 && most < 0.15));
  CHECK(highest > 0);
}

TEST_CASE("walk: a robot without a free trunk is refused") {
  RobotDescription robot = LoadRobot(SourceFile("robots/hopper"));
  robot.task.name = "walk";
  CHECK_THROWS_WITH(MakeTask(robot), Catch::Contains("needs a floating base"));
}

}  // namespace plumb
