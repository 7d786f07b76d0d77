#pragma once

#include <cmath>
#include <vector>

#include "estimator/noise_tuning.h"
#include "estimator/state_observer.h"
#include "tests/estimator/simulated_readings.h"

namespace plumb {

using Recordings = std::vector<std::vector<SimulatedReadings::Sample>>;

/// Errors of one way to estimate one joint.
class StateErrors {
 public:
  void Add(double dq, double dv, double q_sd = NAN, double v_sd = NAN) {
    ++count_;
    q2_ += dq * dq;
    v2_ += dv * dv;
    const double nq = dq / q_sd, nv = dv / v_sd;
    nees_q_ += nq * nq;
    nees_v_ += nv * nv;
    covered_v_ += std::abs(nv) < 1.96;
  }
  double q() const { return std::sqrt(q2_ / count_); }  ///< rms
  double v() const { return std::sqrt(v2_ / count_); }
  double nees_q() const { return nees_q_ / count_; }  ///< 1 if honest
  double nees_v() const { return nees_v_ / count_; }
  /// share of errors within 1.96 sd: 0.95 if honest
  double covered_v() const { return covered_v_ / count_; }

 private:
  double count_ = 0, q2_ = 0, v2_ = 0, nees_q_ = 0, nees_v_ = 0, covered_v_ = 0;
};

struct JointErrors {
  StateErrors differencing;  ///< of the newest two readings
  /// the same through a first-order filter, of the time constant that suits it best
  StateErrors filtered;
  StateErrors causal, smoothed;
};

struct ObserverErrors {
  std::vector<JointErrors> joints;
};

/// The robot with the noise that SimulatedReadings makes, and the delay.
inline RobotDescription WithSimulatedNoise(RobotDescription robot) {
  using S = SimulatedReadings;
  robot.estimator.delay = 1e-6 * S::kDelay;
  for (SensorDescription& sensor : robot.sensors) {
    if (sensor.link < 0) continue;
    sensor.noise.position_sd = S::kAngleNoise;
    sensor.noise.velocity_sd = S::kRateNoise;
    // what it says of its IMU is of another one
    const int turned = MountingOf(robot, sensor.link).turned;
    if (turned >= 0) robot.joints[static_cast<size_t>(turned)].noise.position_sd = S::kAngleNoise;
    if (turned >= 0) robot.joints[static_cast<size_t>(turned)].noise.velocity_sd = S::kRateNoise;
    sensor.rate_bias_sd = S::kRateBias;
    sensor.acceleration_sd = S::kForceNoise;
    sensor.acceleration_bias_sd = S::kForceBias;
  }
  return robot;
}

inline Recordings Record(const RobotDescription& robot, uint32_t first_seed, int runs) {
  Recordings recordings;
  for (uint32_t i = 0; i < static_cast<uint32_t>(runs); ++i) {
    recordings.push_back(robot.num_joints() == 6 ? Hop(robot, first_seed + i)
                                                 : Swing(robot, first_seed + i));
  }
  return recordings;
}

/// Gives the observer one recording after the other, seconds apart.
inline void Play(const Recordings& recordings, StateObserver& observer) {
  int64_t shift = 0;
  for (const auto& recording : recordings) {
    for (const SimulatedReadings::Sample& sample : recording) {
      for (imu_t imu : sample.imus) {
        imu.utime += shift;
        observer.OnImu(imu);
      }
      joint_state_t joints = sample.joints;
      joints.utime += shift;
      for (int64_t& measured : joints.measured) measured += shift;
      observer.OnJointState(joints);
    }
    shift += 60'000'000;
  }
}

inline ObserverErrors Observe(const RobotDescription& robot, const Recordings& recordings) {
  constexpr size_t kSettle = 50;  // samples
  const auto n = static_cast<size_t>(robot.num_joints());
  ObserverErrors errors;
  errors.joints.resize(n);
  std::vector<std::vector<StateErrors>> first_order(n, std::vector<StateErrors>(8));
  for (const auto& recording : recordings) {
    StateObserver observer(robot);
    size_t next_smoothed = 0;
    std::vector<double> last = recording.front().joints.position;
    std::vector<int64_t> last_time = recording.front().joints.measured;
    std::vector<double> difference(n, 0);
    std::vector<std::vector<double>> filtered(n, std::vector<double>(8, 0));
    for (size_t k = 0; k < recording.size(); ++k) {
      const SimulatedReadings::Sample& sample = recording[k];
      for (const imu_t& imu : sample.imus) observer.OnImu(imu);
      observer.OnJointState(sample.joints);
      const auto error = [&](const robot_state_t& state, const SimulatedReadings::Sample& truth,
                             size_t i, StateErrors& into) {
        const auto at = static_cast<Eigen::Index>(i);
        into.Add(state.q[i] - truth.q[at], state.v[i] - truth.v[at], state.q_sd[i], state.v_sd[i]);
      };
      for (size_t i = 0; i < n; ++i) {
        const auto at = static_cast<Eigen::Index>(i);
        const int64_t elapsed = sample.joints.measured[i] - last_time[i];
        if (elapsed > 0)
          difference[i] =
              (sample.joints.position[i] - last[i]) / (1e-6 * static_cast<double>(elapsed));
        last_time[i] = sample.joints.measured[i];
        last[i] = sample.joints.position[i];
        for (size_t f = 0; f < 8; ++f) {
          const double constant = 1e-3 * std::pow(2, f);  // [s] 1 to 128 ms
          filtered[i][f] += (difference[i] - filtered[i][f]) *
                            -std::expm1(-1e-6 * SimulatedReadings::kPeriod / constant);
        }
        if (k < kSettle) continue;
        const double dq = last[i] - sample.q[at];
        errors.joints[i].differencing.Add(dq, difference[i] - sample.v[at]);
        for (size_t f = 0; f < 8; ++f) first_order[i][f].Add(dq, filtered[i][f] - sample.v[at]);
        error(observer.state(), sample, i, errors.joints[i].causal);
      }
      for (const robot_state_t& state : observer.smoothed()) {
        if (next_smoothed >= kSettle) {
          for (size_t i = 0; i < n; ++i)
            error(state, recording[next_smoothed], i, errors.joints[i].smoothed);
        }
        ++next_smoothed;
      }
    }
  }
  for (size_t i = 0; i < n; ++i) {
    errors.joints[i].filtered =
        *std::min_element(first_order[i].begin(), first_order[i].end(),
                          [](const StateErrors& a, const StateErrors& b) { return a.v() < b.v(); });
  }
  return errors;
}

}  // namespace plumb
