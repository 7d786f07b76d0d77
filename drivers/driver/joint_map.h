#pragma once

#include "robot/description.h"

namespace plumb {

/// Between a motor's shaft and its joint. With gear n, sign s and offset o:
///   joint position = s / n * motor position + o,  joint effort = s n * motor torque.
/// SI units on both sides; for a prismatic joint n is in rad/m. Immutable, thread-safe.
class JointMap {
 public:
  /// @throws std::invalid_argument unless gear > 0 and finite, sign is +1 or -1, offset is finite.
  explicit JointMap(const MotorDescription& motor);

  double JointPosition(double motor_position) const { return motor_position / ratio_ + offset_; }
  double JointVelocity(double motor_velocity) const { return motor_velocity / ratio_; }
  double JointEffort(double motor_torque) const { return motor_torque * ratio_; }
  double MotorPosition(double joint_position) const { return (joint_position - offset_) * ratio_; }
  double MotorVelocity(double joint_velocity) const { return joint_velocity * ratio_; }
  double MotorTorque(double joint_effort) const { return joint_effort / ratio_; }

 private:
  double ratio_;  ///< sign times gear
  double offset_;
};

}  // namespace plumb
