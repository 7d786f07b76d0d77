// The time of a step of the observer: build/bench/observer_bench. It is the inverse of items per
// second.

#include <benchmark/benchmark.h>

#include <cmath>
#include <limits>
#include <string>

#include "estimator/state_observer.h"

namespace plumb {
namespace {

/// A thousand steps of readings every 2 ms, and of IMUs every 5 ms, of joints that swing.
void Steps(benchmark::State& state, const std::string& name, int lag) {
  RobotDescription robot = LoadRobot(std::string(PLUMBLINE_SOURCE) + "/robots/" + name);
  robot.estimator.lag = lag;
  const auto n = static_cast<size_t>(robot.num_joints());
  joint_state_t m{};
  m.num_joints = robot.num_joints();
  m.measured.assign(n, 0);
  m.position = m.velocity = m.effort_measured = m.effort_sent = m.effort_applied =
      std::vector<double>(n, 0.0);
  m.valid.assign(n, 1);
  imu_t imu{};
  imu.name = "imu";
  imu.orientation[0] = 1;
  imu.orientation_valid = true;
  imu.force[2] = 9.8;
  StateObserver observer(robot);
  int64_t k = 0;
  for (auto _ : state) {
    for (const int64_t end = k + 1000; k < end; ++k) {
      m.utime = 1'000'000 + 2000 * k;
      m.sequence = k;
      const double phase = 0.01 * static_cast<double>(k);
      for (size_t i = 0; i < n; ++i) {
        const bool passive = robot.joints[i].passive;
        m.measured[i] = m.utime;
        m.position[i] = 0.1 * std::sin(phase);
        m.velocity[i] =
            passive && i < 2 ? std::numeric_limits<double>::quiet_NaN() : 0.5 * std::cos(phase);
        m.effort_applied[i] = 0;
      }
      if (k % 5 == 0 || k % 5 == 3) {
        imu.utime = m.utime - 500;
        observer.OnImu(imu);
      }
      observer.OnJointState(m);
      benchmark::DoNotOptimize(observer.smoothed().data());
    }
  }
  state.SetItemsProcessed(1000 * state.iterations());
}

BENCHMARK_CAPTURE(Steps, hopper_causal, "hopper", 1);
BENCHMARK_CAPTURE(Steps, hopper_smoothed, "hopper", 20);
BENCHMARK_CAPTURE(Steps, free_hopper_causal, "hopper/free.toml", 1);
BENCHMARK_CAPTURE(Steps, pendulum_smoothed, "pendulum", 20);

}  // namespace
}  // namespace plumb
