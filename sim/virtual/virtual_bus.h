#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <functional>
#include <span>
#include <vector>

#include "drivers/driver/driver.h"
#include "plumb/imu_t.hpp"
#include "plumb/joint_state_t.hpp"
#include "robot/description.h"
#include "sim/virtual/virtual_robot.h"

namespace plumb {

/// A virtual robot and its driver on their buses, on a clock that nobody waits for: from event to
/// event, to the microsecond. Equal calls give equal bits. Not thread-safe.
class VirtualBus {
 public:
  struct Wire {
    int64_t to_robot, to_driver;  ///< [us] >= 0
  };
  /// @param robot that is there, with these parameters. @param driven what the driver believes to
  /// be there.
  /// @param start utime of the beginning [us]. @param wire how long frames are on their way.
  /// @param phase [us] >= 0 by which the driver's cycles come after the drives' measurements.
  /// @throws std::invalid_argument, see VirtualRobot and Driver.
  VirtualBus(const RobotDescription& robot, const Eigen::VectorXd& physical,
             const RobotDescription& driven, int64_t start, Wire wire = {0, 0}, int64_t phase = 0);

  /// Whatever happens until then, and nothing after it: `now` is then `until`.
  void Advance(int64_t until);

  int64_t now() const { return now_; }  ///< [us] since the start
  int64_t utime() const { return start_ + now_; }
  VirtualRobot& robot() { return robot_; }
  Driver& driver() { return driver_; }

  /// Called as the driver gives them out.
  std::function<void(const joint_state_t&)> on_state = [](const joint_state_t&) {};
  std::function<void(const imu_t&)> on_imu = [](const imu_t&) {};
  /// Called before each of the driver's cycles: what is commanded here is sent in it.
  std::function<void()> on_cycle = [] {};
  /// Called with every frame when it is put on its bus.
  std::function<void(const Frame&)> on_frame = [](const Frame&) {};

 private:
  struct Flight {
    int64_t arrival;  // `now`
    size_t bus;
    Frame frame;
  };
  void Cycle();
  void Deliver();
  void FromRobot(std::span<const FrameBatch> batches);
  void ToRobot(size_t bus, const Frame& frame);
  void ToDriver(size_t bus, const Frame& frame);

  const int64_t start_;
  const Wire wire_;
  int64_t now_ = 0, next_cycle_;
  VirtualRobot robot_;
  Driver driver_;
  std::deque<Flight> to_robot_, to_driver_;  // in order of arrival
};

}  // namespace plumb
