#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "drivers/can/frame.h"
#include "drivers/can/transport.h"
#include "robot/description.h"

namespace plumb {

/// How a robot moves at an instant.
struct RobotMotion {
  int64_t time;  ///< [us]
  const Eigen::VectorXd &q, &v;
  /// of the joints as their motors have them, before any backlash
  const Eigen::VectorXd &motor_q, &motor_v;
};

/// A drive or a sensor of a virtual robot: what speaks on its bus and feels how it moves. Times are
/// microseconds of one clock and do not decrease. Not thread-safe.
class VirtualDevice {
 public:
  virtual ~VirtualDevice() = default;

  virtual std::vector<Filter> filters() const = 0;
  /// Obeys a frame. @return true if the motion at this instant matters for that: an answer is due,
  /// or another effort.
  virtual bool OnFrame(const Frame& frame, int64_t now) = 0;
  /// Does what is due at motion.time.
  virtual void Tick(const RobotMotion& motion, FrameBatch& out) = 0;
  /// When Tick next has something to do of its own accord.
  virtual int64_t NextDue() const = 0;

  /// Its power comes on while the robot moves like this.
  virtual void Boot(const RobotMotion& motion) = 0;
  /// The robot has moved from one instant to the other.
  virtual void Track(const RobotMotion& from, const RobotMotion& to) = 0;
  /// The robot has been put where it is now.
  virtual void Place(const RobotMotion& motion) = 0;

  /// Index of the joint that a drive moves; -1 of a sensor.
  virtual int joint() const { return -1; }
  /// [Nm] or [N] on its joint from the last OnFrame or Tick on, within the joint's limit.
  virtual double Effort() const { return 0; }
  virtual bool armed() const { return false; }
  /// Why it disarmed itself, frames it could make nothing of: as its protocol numbers and counts
  /// them.
  virtual uint32_t disarm_reason() const { return 0; }
  virtual int64_t rejected() const { return 0; }
};

/// The drives in order of their joints, then the sensors in order.
/// @throws std::invalid_argument if there is no virtual device of a protocol, or a device cannot
/// have its settings.
std::vector<std::unique_ptr<VirtualDevice>> VirtualDevices(const RobotDescription& robot);

/// One each.
std::unique_ptr<VirtualDevice> MakeVirtualDrive(const RobotDescription& robot, int joint);
std::unique_ptr<VirtualDevice> MakeVirtualSensor(const RobotDescription& robot,
                                                 const SensorDescription& sensor);

}  // namespace plumb
