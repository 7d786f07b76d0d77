#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "common/random.h"
#include "tests/calibrator/observed_log.h"
#include "tests/sim/virtual/hopper_bus.h"

namespace plumb {

/// How the hopper on the bus is driven.
enum class Drive {
  kSprings,  ///< as Hop: by springs to a posture that bends and stretches
  /// all or nothing towards the same posture, or at random: into the stops and into the ground
  kBangBang,
};

/// As Hop, but through the whole chain, in virtual time: the virtual robot, its drives and sensors,
/// their frames, the driver. It ends early when a hopper that is driven by bang-bang has fallen.
/// @param seed of the hidden parameters. @param motion its number: another one, another motion.
/// @throws std::runtime_error if the driver stops.
inline Samples HopOnBus(const RobotDescription& robot, uint32_t seed, double duration = 2,
                        Drive drive = Drive::kSprings, uint32_t motion = 0) {
  constexpr double kFull = 200;                 // [Nm]
  constexpr double kFallen = 0.6, kLain = 0.7;  // [m] of the torso, [rad]
  // Driver and drives do not wait for each other.
  HopperBus bus(robot, seed,
                static_cast<int64_t>(Random(seed, {44}).Uniform(0, 1e6 * robot.driver.cycle)));
  Random random = motion == 0 ? Random(seed, {43}) : Random(seed, {43, motion});
  Eigen::VectorXd q(6), v = Eigen::VectorXd::Zero(6);
  q << 0, 1.35 + random.Uniform(0, 0.1), 0.02 * random.Normal(), -0.2, -0.4, 0.2;
  v[0] = random.Uniform(0, 0.5);
  const double frequency = random.Uniform(1.5, 2.5);
  bus.robot.Place(1, q, v);
  bool armed = bus.Arm();
  bus.robot.Place(2, q, v);
  bus.Run(50);  // a hand moves faster than the driver would believe of the robot
  bus.robot.Place(3, q, v);
  bus.states.clear(), bus.imus.clear();

  const int64_t begin = bus.now();
  const int64_t per_control = std::llround(robot.task.period / robot.driver.measurement);
  int64_t answered = -1;
  Eigen::Vector3d held = Eigen::Vector3d::Zero();
  std::array<double, 3> astray{};  // [Nm]
  bus.effort = [&] {
    if (bus.states.empty()) return held;
    const joint_state_t& state = bus.states.back();
    if (state.sequence % per_control != 0 || state.sequence == answered) return held;
    answered = state.sequence;
    const double bend =
        0.5 + 0.5 * std::sin(2e-6 * M_PI * frequency * static_cast<double>(bus.now() - begin));
    const Eigen::Vector3d target(-0.1 - 0.4 * bend, -0.2 - 0.8 * bend, 0.1 + 0.4 * bend);
    for (size_t i = 0; i < 3; ++i) {
      const double wish =
          400 * (target[static_cast<int>(i)] - state.position[3 + i]) - 20 * state.velocity[3 + i];
      held[static_cast<int>(i)] = std::clamp(wish, -kFull, kFull);
      if (drive == Drive::kBangBang) {
        if (random.Uniform(0, 1) < 0.3) astray[i] = 2 * kFull * random.Normal();
        held[static_cast<int>(i)] = std::copysign(kFull, wish + astray[i]);
      }
    }
    return held;
  };
  struct Moment {
    int64_t utime;
    Eigen::VectorXd q, v;
  };
  std::vector<Moment> truth;
  while (armed && bus.now() < begin + std::llround(duration * 1e6)) {
    bus.Step();
    truth.push_back({HopperBus::kStart + bus.now(), bus.robot.q(), bus.robot.v()});
    armed = bus.driver.state() == DriveState::kArmed;
    const Eigen::VectorXd& now = truth.back().q;
    if (drive == Drive::kBangBang && (now[1] < kFallen || std::abs(now[2]) > kLain)) break;
  }
  if (!armed)
    throw std::runtime_error("the driver has stopped: " + std::string(bus.driver.reason()));

  Samples samples;
  size_t next_imu = 0;
  for (const joint_state_t& state : bus.states) {
    const int64_t since = state.utime - truth.front().utime, step = truth[1].utime - truth[0].utime;
    if (since < 0 || since >= truth.back().utime - truth.front().utime) continue;
    const Moment &before = truth[static_cast<size_t>(since / step)],
                 &after = truth[static_cast<size_t>(since / step) + 1];
    const double share =
        static_cast<double>(state.utime - before.utime) / static_cast<double>(step);
    SimulatedReadings::Sample sample{state,
                                     {},
                                     before.q + share * (after.q - before.q),
                                     before.v + share * (after.v - before.v)};
    for (; next_imu < bus.imus.size() && bus.imus[next_imu].utime <= state.utime; ++next_imu) {
      sample.imus.push_back(bus.imus[next_imu]);
    }
    samples.push_back(std::move(sample));
  }
  return samples;
}

/// Episodes of bang-bang until they are `duration` [s] in all.
inline std::vector<Samples> BangBangOnBus(const RobotDescription& robot, uint32_t seed,
                                          double duration = 8) {
  std::vector<Samples> episodes;
  for (uint32_t motion = 1; duration > 0; ++motion) {
    episodes.push_back(HopOnBus(robot, seed, std::min(duration, 2.0), Drive::kBangBang, motion));
    duration -=
        robot.driver.measurement * static_cast<double>(std::max<size_t>(1, episodes.back().size()));
  }
  return episodes;
}

}  // namespace plumb
