#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "drivers/can/frame.h"
#include "drivers/can/transport.h"
#include "robot/configuration_space.h"
#include "robot/description.h"
#include "sim/virtual/effort_delay.h"
#include "sim/virtual/virtual_devices.h"
#include "sim/virtual/virtual_plant.h"

namespace plumb {

/// A virtual robot: a VirtualPlant moved by virtual drives and felt by virtual sensors, all of them
/// on CAN buses, by their indices in RobotDescription::buses. Event-driven, with time as an
/// argument, so that its motion does not depend, to the bit, on when the process gets to run:
/// torques change when their frame arrived, sensors are read at multiples of their periods,
/// watchdogs expire on time. Only the sending can be late. Times are microseconds. Does not throw
/// after construction. Not thread-safe.
class VirtualRobot {
 public:
  /// @param physical the true parameters, order of description.parameters.
  /// @throws std::invalid_argument if no virtual device speaks a motor's or sensor's protocol, or a
  /// parameter is not physical.
  VirtualRobot(const RobotDescription& description, const Eigen::VectorXd& physical, int64_t now);

  /// Frames that a bus must let in.
  std::vector<Filter> filters(size_t bus) const;

  /// Obeys a frame that arrived at that time, after doing what was due before it. Frames must come
  /// in order of arrival; one that seems older than the last counts as simultaneous.
  /// @param out frames to send, for each bus.
  void Receive(size_t bus, const Frame& frame, int64_t arrival, std::span<FrameBatch> out);
  /// Does all that is due until `now`. What would be sent too late by kLatest is not sent, as a
  /// drive's outbox holds the newest only. After a gap of more than kLongestGap, or a step back in
  /// time by as much, the robot carries on at `now` where it was, its drives rebooted.
  void Advance(int64_t now, std::span<FrameBatch> out);
  /// When Advance next has something to do.
  int64_t NextEvent() const;

  /// Puts the robot at these q, v at the time of the latest Advance or Receive, unless the wish of
  /// this utime has been granted before. @return false if the wish is of the wrong size, not finite
  /// or beyond kFarthest.
  bool Place(int64_t utime, const Eigen::Ref<const Eigen::VectorXd>& wish_q,
             const Eigen::Ref<const Eigen::VectorXd>& wish_v);

  static constexpr int64_t kLatest = 50'000;         ///< [us]
  static constexpr int64_t kLongestGap = 5'000'000;  ///< [us]
  static constexpr double kFarthest = 1e4;           ///< [rad, m, rad/s, m/s]

  /// Of q and v: the latest event, not the latest `now`.
  int64_t time() const { return time_; }
  const Eigen::VectorXd& q() const { return plant_.q(); }
  const Eigen::VectorXd& v() const { return plant_.v(); }
  /// The drives in order of their joints, then the sensors.
  const std::vector<std::unique_ptr<VirtualDevice>>& devices() const { return devices_; }

 private:
  void Boot(int64_t now);
  void MoveTo(int64_t time);
  void Tick(std::span<FrameBatch> out);
  RobotMotion Motion() const { return {time_, q(), v(), plant_.motor_q(), plant_.motor_v()}; }

  ConfigurationSpace space_;
  VirtualPlant plant_;
  std::vector<std::unique_ptr<VirtualDevice>> devices_;
  std::vector<size_t> bus_;                 // of each device
  std::vector<Eigen::Index> effort_index_;  // of each device in v; -1: it makes none
  Eigen::VectorXd last_q_, last_v_, last_motor_q_, last_motor_v_;  // before a motion
  EffortDelay efforts_;                                            // that act from time_ on
  std::vector<FrameBatch> unsent_;                        // where frames go that would be too late
  int64_t time_;                                          // of the mechanism
  int64_t latest_;                                        // the latest that we have been told
  int64_t placed_ = std::numeric_limits<int64_t>::min();  // utime of the last wish granted
};

}  // namespace plumb
