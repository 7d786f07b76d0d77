#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numbers>
#include <vector>

#include "common/random.h"
#include "plumb/imu_t.hpp"
#include "plumb/joint_state_t.hpp"
#include "robot/configuration_space.h"
#include "robot/imu_mounting.h"
#include "robot/kinematics.h"
#include "sim/model.h"
#include "sim/virtual/encoder.h"
#include "sim/virtual/virtual_plant.h"

namespace plumb {

/// The messages that a driver would publish of a simulated robot, with imperfections of real
/// sensors, and the truth at every time that is a message's: for tests and bench/observer.
///
/// Drives have an encoder and its tracking loop (sim/virtual/encoder.h) plus white noise on the
/// velocity; joints with an encoder of their own are quantised by its counts; an IMU has white
/// noise, a constant bias, and forces averaged over its period; one on a link that turns freely has
/// a bias about each axis. All messages are labelled with the
/// time of their arrival, kDelay after the measurement, as a driver would that cannot know the
/// constant part of the delay.
class SimulatedReadings {
 public:
  static constexpr int64_t kStep = 500;                    ///< [us] of the truth
  static constexpr int64_t kPeriod = 2000, kDelay = 1000;  ///< [us]
  static constexpr int64_t kStart = 1'000'000;             ///< [us] utime of the beginning
  static constexpr double kVelocityNoise = 0.1;            ///< [rad/s] on a drive's velocity
  /// [rad], [rad/s], [m/s^2]
  static constexpr double kAngleNoise = 2e-3, kRateNoise = 0.01, kForceNoise = 0.1;
  /// [rad/s], [m/s^2]
  static constexpr double kRateBias = 0.01, kForceBias = 0.1;
  static constexpr double kTiming = 2e-5;  ///< [s] error of a regularised time

  struct Sample {
    joint_state_t joints;
    std::vector<imu_t> imus;  ///< that came before it
    Eigen::VectorXd q, v;     ///< at joints.utime
  };

  /// @param truth the robot's parameters; nothing = the prior's mean.
  SimulatedReadings(const RobotDescription& robot, uint32_t seed, const Eigen::VectorXd& truth = {})
      : robot_(robot),
        random_(seed, {41}),
        space_(robot),
        kinematics_(robot),
        mechanism_(Model(robot).Describe(truth.size() > 0 ? truth : PriorMean(robot))) {
    Eigen::Index position = 0, velocity = 0;
    for (const JointDescription& joint : robot.joints) {
      encoders_.emplace_back(robot.virtual_robot.encoder_bits);
      position_.push_back(position), velocity_.push_back(velocity);
      position += joint.num_positions(), velocity += joint.num_velocities();
    }
    bias_ = kForceBias * Eigen::Vector3d(random_.Normal(), random_.Normal(), random_.Normal());
    rate_bias_ = kRateBias * random_.Normal();
    if (!space_.flat()) {
      rate_biases_ =
          kRateBias * Eigen::Vector3d(random_.Normal(), random_.Normal(), random_.Normal());
    }
    for (const SensorDescription& sensor : robot.sensors) {
      if (sensor.link < 0) continue;
      imu_ = &sensor;
      mounting_ = MountingOf(robot, sensor.link);
    }
  }

  /// @param effort of the driven joints from time [s], q, v; asked every `control` [us], it acts a
  /// measurement later.
  std::vector<Sample> Run(const Eigen::VectorXd& q, const Eigen::VectorXd& v, double duration,
                          int64_t control,
                          const std::function<Eigen::VectorXd(double, const Eigen::VectorXd&,
                                                              const Eigen::VectorXd&)>& effort) {
    mechanism_.SetState(q, v);
    for (size_t i = 0; i < encoders_.size(); ++i) encoders_[i].Reset(Angle(q, i), Rate(v, i));
    Eigen::VectorXd applied = Eigen::VectorXd::Zero(robot_.num_velocities()), impulse = applied;
    std::vector<Sample> samples;
    joint_state_t reading{};
    std::vector<imu_t> imus;
    Eigen::VectorXd last_v = v;  // at the IMU's last reading
    for (int64_t t = 0; t <= std::llround(duration * 1e6); t += kStep) {
      if (t % kPeriod == kDelay % kPeriod && t > kDelay) {  // the reading of kDelay ago arrives
        for (size_t i = 0; i < encoders_.size(); ++i) {
          reading.effort_applied[i] = impulse[velocity_[i]] / (1e-6 * kPeriod);
          reading.effort_sent[i] = applied[velocity_[i]];
        }
        // The state is of the time that the message names, which is off a little.
        const double off = 1e-6 * static_cast<double>(reading.utime - kStart - t);
        samples.push_back(
            {reading, imus, space_.Move(mechanism_.q(), off * mechanism_.v()), mechanism_.v()});
        imus.clear();
        impulse.setZero();
      }
      if (imu_ && t % std::llround(imu_->period * 1e6) == 0) ReadImu(t, last_v, imus);
      if (t % kPeriod == 0) reading = Read(t);
      if (t % control == 0) {
        Eigen::VectorXd wish =
            effort(1e-6 * static_cast<double>(t), mechanism_.q(), mechanism_.v());
        Eigen::Index k = 0;
        for (const int i : robot_.driven()) {
          const double limit = robot_.joints[static_cast<size_t>(i)].effort_limit;
          applied[velocity_[static_cast<size_t>(i)]] = std::clamp(wish[k++], -limit, limit);
        }
      }
      const Eigen::VectorXd q0 = mechanism_.q(), v0 = mechanism_.v();
      mechanism_.Advance(applied, 1e-6 * kStep);
      impulse += applied * (1e-6 * kStep);
      for (size_t i = 0; i < encoders_.size(); ++i) {
        encoders_[i].Track({t, t + kStep, Angle(q0, i), Angle(mechanism_.q(), i), Rate(v0, i),
                            Rate(mechanism_.v(), i)});
      }
    }
    return samples;
  }

 private:
  static Eigen::VectorXd PriorMean(const RobotDescription& robot) {
    Eigen::VectorXd mean(static_cast<Eigen::Index>(robot.parameters.size()));
    for (size_t i = 0; i < robot.parameters.size(); ++i)
      mean[static_cast<Eigen::Index>(i)] = robot.parameters[i].coordinate_mean();
    return robot.ToPhysical(mean);
  }
  // In turns, of joint i.
  double Angle(const Eigen::VectorXd& q, size_t i) const {
    return q[position_[i]] / (2 * std::numbers::pi);
  }
  double Rate(const Eigen::VectorXd& v, size_t i) const {
    return v[velocity_[i]] / (2 * std::numbers::pi);
  }

  joint_state_t Read(int64_t t) {
    joint_state_t m{};
    m.utime = kStart + t + kDelay + std::llround(1e6 * kTiming * random_.Normal());
    m.sequence = sequence_++;
    m.num_joints = robot_.num_joints();
    const auto n = encoders_.size();
    m.measured.assign(n, m.utime);
    m.position.resize(n);
    m.velocity.resize(n);
    m.effort_measured = m.effort_sent = m.effort_applied = std::vector<double>(n, 0.0);
    m.valid.assign(n, 1);
    for (size_t i = 0; i < n; ++i) {
      m.position[i] = encoders_[i].Quantise(Angle(mechanism_.q(), i)) * 2 * std::numbers::pi;
      m.velocity[i] =
          encoders_[i].velocity() * 2 * std::numbers::pi + kVelocityNoise * random_.Normal();
    }
    for (const SensorDescription& sensor : robot_.sensors) {
      if (sensor.link >= 0) continue;
      const auto i = static_cast<size_t>(sensor.joint);
      const double quantum = sensor.radius * 2 * std::numbers::pi / sensor.counts;
      m.position[i] = std::round(mechanism_.q()[sensor.joint] / quantum) * quantum;
      m.velocity[i] = std::numeric_limits<double>::quiet_NaN();
    }
    for (size_t i = 0; i < n; ++i) {
      if (robot_.joints[i].passive && !space_.flat()) m.valid[i] = 0;
    }
    if (imu_ && mounting_.turned >= 0) {
      const auto i = static_cast<size_t>(mounting_.turned);
      m.measured[i] = angle_utime_;
      m.position[i] = angle_;
      m.velocity[i] = rate_;
    }
    return m;
  }

  imu_t Reading(int64_t t, const Eigen::Vector3d& force, const Eigen::Vector3d& rate,
                const Eigen::Quaterniond& orientation) const {
    imu_t imu{};
    imu.utime = kStart + t + kDelay;
    imu.name = imu_->name;
    imu.link = robot_.links[static_cast<size_t>(imu_->link)].name;
    std::copy_n(force.data(), 3, std::begin(imu.force));
    std::copy_n(rate.data(), 3, std::begin(imu.rate));
    imu.orientation[0] = orientation.w(), imu.orientation[1] = orientation.x(),
    imu.orientation[2] = orientation.y(), imu.orientation[3] = orientation.z();
    imu.orientation_valid = true;
    return imu;
  }

  // On a link that turns freely.
  void ReadFreeImu(int64_t t, std::vector<imu_t>& out) {
    kinematics_.Update(mechanism_.q(), mechanism_.v());
    const LinkMotion& link = kinematics_.link(imu_->link);
    const auto noise = [&](double sd) -> Eigen::Vector3d {
      return sd * Eigen::Vector3d(random_.Normal(), random_.Normal(), random_.Normal());
    };
    const Eigen::Vector3d acceleration = (link.velocity - last_velocity_) / imu_->period;
    last_velocity_ = link.velocity;
    const Eigen::Vector3d up = robot_.simulation.gravity * Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d rate =
        link.rotation.transpose() * link.rate + rate_biases_ + noise(kRateNoise);
    const Eigen::Vector3d force =
        link.rotation.transpose() * (acceleration + up) + bias_ + noise(kForceNoise);
    const Eigen::Vector3d off = noise(kAngleNoise);
    const Eigen::Quaterniond told =
        Eigen::Quaterniond(link.rotation) *
        Eigen::Quaterniond(1, off.x() / 2, off.y() / 2, off.z() / 2).normalized();
    if (t > 0) out.push_back(Reading(t, force, rate, told));
  }

  void ReadImu(int64_t t, Eigen::VectorXd& last_v, std::vector<imu_t>& out) {
    if (!space_.flat()) return ReadFreeImu(t, out);
    angle_utime_ = kStart + t + kDelay;
    angle_ = mechanism_.q()[mounting_.turned] + kAngleNoise * random_.Normal();
    rate_ = mechanism_.v()[mounting_.turned] + rate_bias_ + kRateNoise * random_.Normal();
    Eigen::Vector3d acceleration = robot_.simulation.gravity * Eigen::Vector3d::UnitZ();
    for (const auto& slide : mounting_.slides) {
      acceleration +=
          slide.direction * (mechanism_.v()[slide.joint] - last_v[slide.joint]) / imu_->period;
    }
    last_v = mechanism_.v();
    const Eigen::Quaterniond truth =
        mounting_.unturned *
        Eigen::Quaterniond(Eigen::AngleAxisd(mechanism_.q()[mounting_.turned], mounting_.axis));
    const Eigen::Quaterniond told =
        mounting_.unturned * Eigen::Quaterniond(Eigen::AngleAxisd(angle_, mounting_.axis));
    const Eigen::Vector3d force =
        truth.conjugate() * acceleration + bias_ +
        kForceNoise * Eigen::Vector3d(random_.Normal(), random_.Normal(), random_.Normal());
    const Eigen::Vector3d rate = mounting_.axis * rate_;
    if (t > 0) out.push_back(Reading(t, force, rate, told));
  }

  RobotDescription robot_;
  Random random_;
  ConfigurationSpace space_;
  Kinematics kinematics_;
  VirtualPlant mechanism_;
  std::vector<Encoder> encoders_;
  std::vector<Eigen::Index> position_, velocity_;  // of the joints' first entries
  const SensorDescription* imu_ = nullptr;
  ImuMounting mounting_;
  Eigen::Vector3d bias_, rate_biases_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d last_velocity_ = Eigen::Vector3d::Zero();  // of a link that turns freely
  double rate_bias_ = 0, angle_ = 0, rate_ = 0;
  int64_t angle_utime_ = kStart, sequence_ = 0;
};

/// A pendulum that is pumped, 10 s.
inline std::vector<SimulatedReadings::Sample> Swing(const RobotDescription& robot, uint32_t seed,
                                                    double duration = 10,
                                                    const Eigen::VectorXd& truth = {}) {
  Random random(seed, {42});
  const Eigen::VectorXd q = Eigen::VectorXd::Constant(1, random.Uniform(-3, 3)),
                        v = Eigen::VectorXd::Constant(1, random.Uniform(-1, 1));
  return SimulatedReadings(robot, seed, truth)
      .Run(q, v, duration, 50'000, [&](double, const auto&, const auto& now) {
        return Eigen::VectorXd::Constant(1, (now[0] > 0 ? 1.5 : -1.5) + random.Normal());
      });
}

/// A hopper that falls on its foot and pushes off again and again, 2 s.
inline std::vector<SimulatedReadings::Sample> Hop(const RobotDescription& robot, uint32_t seed,
                                                  double duration = 2,
                                                  const Eigen::VectorXd& truth = {}) {
  Random random(seed, {43});
  Eigen::VectorXd q(6), v = Eigen::VectorXd::Zero(6);
  q << 0, 1.35 + random.Uniform(0, 0.1), 0.02 * random.Normal(), -0.2, -0.4, 0.2;
  v[0] = random.Uniform(0, 0.5);
  const double frequency = random.Uniform(1.5, 2.5);
  return SimulatedReadings(robot, seed, truth)
      .Run(q, v, duration, 8000, [=](double t, const auto& q_now, const auto& v_now) {
        const double bend = 0.5 + 0.5 * std::sin(2 * std::numbers::pi * frequency * t);
        const Eigen::Vector3d target(-0.1 - 0.4 * bend, -0.2 - 0.8 * bend, 0.1 + 0.4 * bend);
        return Eigen::VectorXd(400 * (target - q_now.template tail<3>()) -
                               20 * v_now.template tail<3>());
      });
}

}  // namespace plumb
