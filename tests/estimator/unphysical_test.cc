// What cannot be, but is said: it never gets into a filter, or the filter gets over it.

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "common/random.h"
#include "common/special_numbers.h"
#include "estimator/state_observer.h"
#include "tests/sim/robots.h"

namespace plumb {
namespace {

bool Finite(const robot_state_t& state) {
  bool finite = true;
  for (const auto* values : {&state.q, &state.v, &state.q_sd, &state.v_sd})
    finite = finite &&
             std::all_of(values->begin(), values->end(), [](double x) { return std::isfinite(x); });
  return finite;
}

// At rest, at 200 Hz.
joint_state_t Still(const RobotDescription& robot, int64_t k) {
  const auto n = static_cast<size_t>(robot.num_joints());
  joint_state_t m{};
  m.utime = 1'000'000 + 5000 * k;
  m.sequence = k;
  m.num_joints = robot.num_joints();
  m.measured.assign(n, m.utime);
  m.position.assign(n, 0);
  for (auto* values : {&m.velocity, &m.effort_measured, &m.effort_sent, &m.effort_applied})
    values->assign(n, 0);
  m.valid.assign(n, 1);
  return m;
}

imu_t StillImu(const RobotDescription& robot, int64_t k) {
  imu_t imu{};
  imu.utime = 1'000'000 + 5000 * k - 500;
  for (const SensorDescription& sensor : robot.sensors) {
    if (sensor.link >= 0) imu.name = sensor.name;
  }
  imu.force[2] = 9.81;
  imu.orientation[0] = 1;
  imu.orientation_valid = true;
  return imu;
}

TEST_CASE("a time that is none is refused, also of a joint that was not measured") {
  const RobotDescription robot = LoadPendulum("robot.toml");
  for (const int64_t forged :
       {std::numeric_limits<int64_t>::max(), std::numeric_limits<int64_t>::min()}) {
    StateObserver observer(robot);
    for (int k = 0; k < 10; ++k) REQUIRE(observer.OnJointState(Still(robot, k)));
    joint_state_t m = Still(robot, 10);
    m.valid[0] = 0, m.measured[0] = forged;
    CHECK_FALSE(observer.OnJointState(m));
    CHECK(observer.OnJointState(Still(robot, 11)));
  }
}

TEST_CASE("a sensor's reading may be half a measurement period ahead") {
  RobotDescription robot = LoadPendulum("robot.toml");
  const auto accepts = [&](int64_t ahead) {
    StateObserver observer(robot);
    for (int k = 0; k < 10; ++k) REQUIRE(observer.OnJointState(Still(robot, k)));
    joint_state_t m = Still(robot, 10);
    m.measured[0] += ahead;
    return observer.OnJointState(m);
  };
  CHECK(accepts(9'000));
  CHECK_FALSE(accepts(20'000));
  robot.driver.measurement = 0.05;
  CHECK(accepts(20'000));
  CHECK_FALSE(accepts(26'000));
}

TEST_CASE(
    "one effort, velocity or position that is not physical is refused, and the next is used") {
  const RobotDescription robot = LoadPendulum("robot.toml");
  for (const double forged : {1e308, -1e308, 1e200, 1e150, 1e10, kInfinity}) {
    for (std::vector<double> joint_state_t::*field :
         {&joint_state_t::effort_applied, &joint_state_t::effort_sent, &joint_state_t::velocity,
          &joint_state_t::position}) {
      StateObserver observer(robot);
      for (int k = 0; k < 10; ++k) REQUIRE(observer.OnJointState(Still(robot, k)));
      joint_state_t m = Still(robot, 10);
      (m.*field)[0] = forged;
      CHECK_FALSE(observer.OnJointState(m));
      REQUIRE(observer.OnJointState(Still(robot, 11)));
      CHECK(observer.state().valid);
      CHECK_FALSE(observer.state().restarted);
      CHECK(std::abs(observer.state().q[0]) < 1e-3);
      CHECK(observer.unused() == 1);
    }
  }
}

TEST_CASE("an effort is at most ten times the strongest motor's limit") {
  const RobotDescription robot = LoadPendulum("robot.toml");
  StateObserver observer(robot);
  joint_state_t m = Still(robot, 0);
  m.effort_applied[0] = 10.1 * robot.joints[0].effort_limit;
  CHECK_FALSE(observer.OnJointState(m));
  m.effort_applied[0] = -9.9 * robot.joints[0].effort_limit;
  CHECK(observer.OnJointState(m));
}

// Whatever is said, in whatever order: a valid state is finite, and a second after the last lie the
// filter knows the truth again.
TEST_CASE("a state that is valid is finite, whatever the sensors say") {
  for (const char* file :
       {"robots/pendulum/robot.toml", "robots/hopper/robot.toml", "robots/hopper/free.toml"}) {
    const RobotDescription robot = LoadRobot(SourceFile(file));
    CAPTURE(file);
    for (uint32_t seed = 0; seed < 40; ++seed) {
      Random random(seed, {19});
      const auto strange = [&] {
        const double size = std::pow(10, random.Uniform(-320, 20));
        const double values[] = {NAN, kInfinity, size, -size, 9.9e8, -9.9e8, 0};
        return values[static_cast<size_t>(random.Uniform() * 7)];
      };
      StateObserver observer(robot);
      int64_t k = 0;
      const auto look = [&](const joint_state_t& measured, const imu_t& imu) {
        observer.OnImu(imu);
        if (!observer.OnJointState(measured)) return;
        if (observer.state().valid) REQUIRE(Finite(observer.state()));
        for (const robot_state_t& state : observer.smoothed()) {
          if (state.valid) REQUIRE(Finite(state));
        }
      };
      for (; k < 400; ++k) {
        joint_state_t measured = Still(robot, k);
        imu_t imu = StillImu(robot, k);
        const auto forge = [&](auto& values) {
          for (double& x : values) {
            if (random.Uniform() < 0.2) x = strange();
          }
        };
        if (random.Uniform() < 0.3) forge(measured.effort_applied), forge(measured.effort_sent);
        if (random.Uniform() < 0.1) forge(measured.velocity);
        if (random.Uniform() < 0.1) forge(measured.position);
        if (random.Uniform() < 0.3) forge(imu.rate), forge(imu.force);
        for (auto& valid : measured.valid) valid = random.Uniform() < 0.95;
        look(measured, imu);
      }
      for (const int64_t end = k + 600; k < end; ++k) look(Still(robot, k), StillImu(robot, k));
      for (int i = 0; i < robot.num_joints(); ++i) {
        if (!observer.of_base(i))
          REQUIRE(std::abs(observer.state().q[static_cast<size_t>(i)]) < 0.05);
      }
    }
  }
}

}  // namespace
}  // namespace plumb
