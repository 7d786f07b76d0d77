#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <vector>

#include "sim/parameters.h"
#include "sim/virtual/virtual_bus.h"

namespace plumb {

/// A hopper and its driver.
struct HopperBus {
  static constexpr int64_t kStart = 1'700'000'000'000'000;  ///< [us]

  explicit HopperBus(const RobotDescription& hopper, uint64_t seed = 3, int64_t phase = 0)
      : description(hopper),
        bus(description, HiddenParameters(description, seed), description, kStart, {0, 0}, phase) {
    bus.on_state = [this](const joint_state_t& state) {
      states.push_back(state);
      truth_q.push_back(robot.q());
      truth_v.push_back(robot.v());
    };
    bus.on_imu = [this](const imu_t& imu) { imus.push_back(imu); };
    bus.on_frame = [this](const Frame& frame) { ++count[frame.id]; };
    bus.on_cycle = [this] {
      if (commanding) Command();
    };
  }

  /// Standing, bent a little.
  bool Place(int64_t wish) {
    Eigen::VectorXd q(6);
    q << 2.5, 1.35, 0.03, -0.05, -0.1, 0.02;
    return robot.Place(wish, q, Eigen::VectorXd::Zero(6));
  }

  int64_t now() const { return bus.now(); }
  /// 100 us
  void Step() { bus.Advance(now() + 100); }
  void Run(int64_t milliseconds) { bus.Advance(now() + 1000 * milliseconds); }
  bool Arm() {
    Run(500);
    driver_request_t arm{};
    arm.utime = bus.utime();
    arm.request = driver_request_t::ARM;
    driver.OnRequest(arm, bus.now(), bus.utime());
    commanding = true;
    for (int i = 0; i < 20'000 && driver.state() != DriveState::kArmed; ++i) Step();
    return driver.state() == DriveState::kArmed;
  }

  RobotDescription description;
  VirtualBus bus;
  VirtualRobot& robot = bus.robot();
  Driver& driver = bus.driver();
  bool commanding = false;
  /// [Nm] of the driven joints; asked once per cycle.
  std::function<Eigen::Vector3d()> effort = [] { return Eigen::Vector3d::Zero().eval(); };
  std::vector<joint_state_t> states;
  std::vector<Eigen::VectorXd> truth_q, truth_v;  // when each state was given out
  std::vector<imu_t> imus;
  std::map<uint32_t, int> count;  // of frames by id

 private:
  void Command() {
    joint_command_t command{};
    command.utime = bus.utime();
    command.sequence = sequence_++;
    // between episodes, where a robot may be placed
    command.episode = command.step = command.policy_iteration = -1;
    command.num_joints = description.num_joints();
    const auto n = static_cast<size_t>(description.num_joints());
    command.effort.assign(n, 0);
    const Eigen::Vector3d wish = effort();
    std::copy(wish.begin(), wish.end(), command.effort.begin() + 3);
    for (auto* none : {&command.position, &command.velocity, &command.kp, &command.kd}) {
      none->assign(n, std::numeric_limits<double>::quiet_NaN());
    }
    driver.OnCommand(command, bus.now(), bus.utime());
  }
  int64_t sequence_ = 0;
};

}  // namespace plumb
