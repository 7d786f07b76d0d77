#include "estimator/state_observer.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

namespace plumb {
namespace {

RobotDescription Robot() {
  RobotDescription robot{};
  robot.joints.resize(1);
  robot.joints[0].effort_limit = 2;
  robot.estimator = {.position_sd = 1.2e-4,
                     .velocity_sd = 0.5,
                     .jerk = 100,
                     .effort_step = 30,
                     .timing_sd = 0,
                     .lag = 4,
                     .reset_after = 0.2};
  return robot;
}

joint_state_t Measured(int64_t sequence, double position, double velocity = 0) {
  joint_state_t m{};
  m.utime = 1'000'000 + 5000 * sequence;
  m.sequence = sequence;
  m.num_joints = 1;
  m.measured = {m.utime};
  m.position = {position};
  m.velocity = {velocity};
  m.effort_measured = m.effort_sent = m.effort_applied = {0.0};
  m.valid = {1};
  return m;
}

TEST_CASE("every sequence number comes out twice, causal at once and smoothed after the lag") {
  StateObserver observer(Robot());
  std::vector<int64_t> smoothed;
  for (int i = 0; i < 20; ++i) {
    REQUIRE(observer.OnJointState(Measured(i, 0.01 * i, 2)));
    CHECK(observer.state().sequence == i);
    CHECK(observer.state().valid == (i >= 5));
    for (const robot_state_t& state : observer.smoothed()) smoothed.push_back(state.sequence);
  }
  REQUIRE(smoothed.size() == 16);
  for (size_t i = 0; i < smoothed.size(); ++i) CHECK(smoothed[i] == static_cast<int64_t>(i));
}

TEST_CASE("a robot moved by hand restarts the filter and flushes the smoother") {
  StateObserver observer(Robot());
  for (int i = 0; i < 10; ++i) observer.OnJointState(Measured(i, 0));
  REQUIRE(observer.OnJointState(Measured(10, 3.0, -1)));
  CHECK(observer.state().restarted);
  CHECK_FALSE(observer.state().valid);
  CHECK(observer.state().q[0] == 3.0);
  CHECK(observer.state().v[0] == -1.0);
  const auto smoothed = observer.smoothed();
  REQUIRE(smoothed.size() == 4);
  CHECK(smoothed.back().sequence == 9);
  CHECK(std::abs(smoothed.back().q[0]) < 1e-9);  // untouched by what came after
}

TEST_CASE("a robot that is placed restarts the filter, however near it is put, and for 50 ms") {
  StateObserver observer(Robot()), untold(Robot());
  observer.Place();  // before it has begun it has nothing to forget
  for (int i = 0; i < 20; ++i) observer.OnJointState(Measured(i, 0));
  CHECK(observer.restarts() == 0);
  CHECK(observer.state().valid);
  for (int i = 0; i < 20; ++i) untold.OnJointState(Measured(i, 0));
  observer.Place();
  for (int i = 20; i < 60; ++i) {
    observer.OnJointState(Measured(i, 0.1, 1));
    untold.OnJointState(Measured(i, 0.1, 1));
    INFO(i);
    CHECK(observer.state().restarted == (i < 30));
    CHECK_FALSE(untold.state().restarted);
    if (i < 30) CHECK(observer.state().q[0] == 0.1);
  }
  CHECK(observer.state().valid);
  CHECK(observer.deviance(0) < untold.deviance(0) - 1000);

  observer.Place();
  joint_state_t back = Measured(61, 0.1);
  back.utime = back.measured[0] = 500'000;  // a clock that was set back: nothing of it is known
  observer.OnJointState(back);
  back.utime = back.measured[0] += 5'000;
  observer.OnJointState(back);
  CHECK_FALSE(observer.state().restarted);
}

TEST_CASE("jumps of time restart it, repeated times and rubbish are refused") {
  StateObserver observer(Robot());
  for (int i = 0; i < 10; ++i) observer.OnJointState(Measured(i, 0));
  joint_state_t m = Measured(10, 0);
  SECTION("backwards") {
    m.utime = m.measured[0] = 500'000;
    REQUIRE(observer.OnJointState(m));
    CHECK(observer.state().restarted);
  }
  SECTION("far forwards") {
    m.measured[0] = m.utime += 2'000'000;
    REQUIRE(observer.OnJointState(m));
    CHECK(observer.state().restarted);
  }
  SECTION("a lost message is bridged") {
    m.measured[0] = m.utime += 5000;
    REQUIRE(observer.OnJointState(m));
    CHECK_FALSE(observer.state().restarted);
  }
  SECTION("the same time twice") {
    m.utime -= 5000;
    CHECK_FALSE(observer.OnJointState(m));
  }
  SECTION("not finite") {
    m.position[0] = std::numeric_limits<double>::quiet_NaN();
    CHECK_FALSE(observer.OnJointState(m));
  }
  SECTION("a time that no clock shows") {
    for (const int64_t utime :
         {std::numeric_limits<int64_t>::min(), std::numeric_limits<int64_t>::max()}) {
      m.utime = utime;
      CHECK_FALSE(observer.OnJointState(m));
    }
  }
  SECTION("another robot's") {
    m.num_joints = 2;
    m.position = m.velocity = {0, 0};
    CHECK_FALSE(observer.OnJointState(m));
  }
  SECTION("a joint measured in the future, or too long ago") {
    for (const int64_t measured :
         {m.utime + 10'001, m.utime - 1'100'000, std::numeric_limits<int64_t>::min()}) {
      m.measured[0] = measured;
      CHECK_FALSE(observer.OnJointState(m));
    }
  }
  SECTION("an old reading is not used twice") {
    m.measured[0] -= 5000;
    m.position[0] = 1;  // whatever it says: this is the reading of before
    REQUIRE(observer.OnJointState(m));
    CHECK(observer.state().q[0] == Approx(0).margin(1e-9));
  }
  SECTION("an unknown effort is not a reason to stop") {
    m.effort_applied[0] = std::numeric_limits<double>::quiet_NaN();
    REQUIRE(observer.OnJointState(m));
    CHECK(observer.state().valid);
    CHECK(std::isnan(observer.state().effort[0]));
  }
}

}  // namespace
}  // namespace plumb
