// No allocation in a step of the observer, whatever happens in it.

#include <catch2/catch.hpp>
#include <cmath>

#include "estimator/state_observer.h"
#include "tests/sim/allocations.h"

namespace plumb {
namespace {

TEST_CASE("a thousand steps with noise, outages, lies, restarts and rubbish allocate nothing") {
  RobotDescription robot{};
  robot.joints.resize(3);
  for (JointDescription& joint : robot.joints) joint.effort_limit = 2;
  robot.estimator = {.position_sd = 1.2e-4,
                     .velocity_sd = 0.5,
                     .jerk = 100,
                     .effort_step = 30,
                     .timing_sd = 0,
                     .lag = 20,
                     .reset_after = 0.2};
  robot.links.resize(1);
  SensorDescription sensor;
  sensor.name = "imu";
  sensor.link = 0;
  sensor.period = 0.005;
  robot.sensors.push_back(sensor);
  StateObserver observer(robot);

  joint_state_t m{};
  m.num_joints = 3;
  m.position = m.velocity = m.effort_measured = m.effort_sent = m.effort_applied = {0, 0, 0};
  m.measured = {0, 0, 0};
  m.valid = {1, 1, 1};
  imu_t imu{};
  imu.name = "imu";
  imu.orientation[0] = 1;
  imu.orientation_valid = true;
  int valid = 0, smoothed = 0;
  int64_t counted = 0;
  for (int k = 0; k < 1000; ++k) {
    m.sequence = k;
    m.utime = 1'000'000 + 2000 * k;
    for (size_t i = 0; i < 3; ++i) {
      m.measured[i] = m.utime;
      m.position[i] = std::sin(0.01 * k) + (k % 300 > 280 ? 5 : 0);
      m.velocity[i] = k % 500 > 300 ? 7 : 5 * std::cos(0.01 * k);
      m.valid[i] = !(i == 1 && k % 200 > 150);
      m.effort_applied[i] = k % 7 ? 1 : NAN;
    }
    if (k % 50 == 0) m.position[0] = NAN;
    imu.utime = m.utime - 500;
    const int64_t before = Allocations();
    observer.OnImu(imu);
    observer.OnImu(imu);
    observer.OnJointState(m);
    observer.OnJointState(m);
    counted += Allocations() - before;
    valid += observer.state().valid;
    smoothed += observer.smoothed().empty() ? 0 : 1;
  }
  CHECK(counted == 0);
  CHECK(valid > 300);
  CHECK(observer.restarts() > 5);
  CHECK(observer.Status().imu_duplicates == 1000);
}

}  // namespace
}  // namespace plumb
