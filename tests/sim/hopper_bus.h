#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <vector>

#include "drivers/driver.h"
#include "sim/parameters.h"
#include "sim/virtual_robot.h"

namespace plumb {

/// A hopper and its driver, 100 us by 100 us.
struct HopperBus {
  static constexpr int64_t kStart = 1'700'000'000'000'000;  ///< [us]

  explicit HopperBus(const RobotDescription& hopper, uint64_t seed = 3)
      : description(hopper),
        robot(description, HiddenParameters(description, seed), kStart),
        driver(description, 0, kStart) {
    driver.set_virtual(true);
  }

  /// Standing, bent a little.
  bool Place(int64_t wish) {
    Eigen::VectorXd q(6);
    q << 2.5, 1.35, 0.03, -0.05, -0.1, 0.02;
    return robot.Place(wish, q, Eigen::VectorXd::Zero(6));
  }

  void Step() {
    now += 100;
    FrameBatch out;
    robot.Advance(kStart + now, out);
    Deliver(out);
    while (const joint_state_t* state = driver.NextState()) {
      states.push_back(*state);
      truth_q.push_back(robot.q());
      truth_v.push_back(robot.v());
    }
    while (const imu_t* imu = driver.NextImu()) imus.push_back(*imu);
    if (now % driver.cycle() != 0) return;
    if (commanding) Command();
    const auto frames = driver.Tick(now, kStart + now, 0);
    std::vector<Frame> sent(frames.begin(), frames.end());
    driver.Transmitted(static_cast<int>(sent.size()), kStart + now);
    for (const Frame& frame : sent) {
      ++count[frame.id];
      FrameBatch answers;
      robot.Receive(frame, kStart + now, answers);
      Deliver(answers);
    }
  }
  void Run(int64_t milliseconds) {
    for (int64_t end = now + 1000 * milliseconds; now < end;) Step();
  }
  bool Arm() {
    Run(500);
    driver_request_t arm{};
    arm.utime = kStart + now;
    arm.request = driver_request_t::ARM;
    driver.OnRequest(arm, now, kStart + now);
    commanding = true;
    for (int i = 0; i < 20'000 && driver.state() != DriveState::kArmed; ++i) Step();
    return driver.state() == DriveState::kArmed;
  }

  RobotDescription description;
  VirtualRobot robot;
  Driver driver;
  int64_t now = 0;
  bool commanding = false;
  /// [Nm] of the driven joints; asked once per cycle.
  std::function<Eigen::Vector3d()> effort = [] { return Eigen::Vector3d::Zero().eval(); };
  std::vector<joint_state_t> states;
  std::vector<Eigen::VectorXd> truth_q, truth_v;  // when each state was given out
  std::vector<imu_t> imus;
  std::map<uint32_t, int> count;  // of frames by id

 private:
  void Deliver(const FrameBatch& batch) {
    for (const Frame& frame : batch.frames()) {
      ++count[frame.id];
      driver.OnFrame(frame, now, kStart + now);
    }
  }
  void Command() {
    joint_command_t command{};
    command.utime = kStart + now;
    command.sequence = sequence_++;
    command.num_joints = description.num_joints();
    const auto n = static_cast<size_t>(description.num_joints());
    command.effort.assign(n, 0);
    const Eigen::Vector3d wish = effort();
    std::copy(wish.begin(), wish.end(), command.effort.begin() + 3);
    for (auto* none : {&command.position, &command.velocity, &command.kp, &command.kd}) {
      none->assign(n, std::numeric_limits<double>::quiet_NaN());
    }
    driver.OnCommand(command, now, kStart + now);
  }
  int64_t sequence_ = 0;
};

}  // namespace plumb
