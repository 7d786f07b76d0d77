#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

#include "common/config.h"
#include "robot/settings/estimator.h"

namespace plumb {

struct RobotDescription;

/// A sensor on a bus: an encoder of a joint, or an IMU on a link.
struct SensorDescription {
  std::string name;
  /// file name in drivers/protocols/: "cia406", an encoder, or "xsens", an IMU
  std::string protocol;
  size_t bus = 0;     ///< index into the robot's buses
  double period = 0;  ///< [s] > 0 of its readings

  // Of an encoder. It measures a joint: position = sign * radius * angle + offset.
  int joint = -1;     ///< index into joints
  int node = 0;       ///< CANopen node id, 1 to 127
  double counts = 0;  ///< per turn, > 0
  /// counts after which it begins anew, >= 2, <= 2^32; `counts` of a single-turn one
  double range = 0;
  int sign = 1;          ///< +1 or -1
  double offset = 0;     ///< [rad] or [m]
  double radius = 1;     ///< 1 at a joint that turns, [m] > 0 at one that slides: the boom's length
  double max_speed = 0;  ///< [rad/s] > 0 of the shaft; a reading that needs more is a fault
  /// [rad] or [m] > 0 by which it may differ from the motor of its joint, if that has one; infinite
  /// = not compared
  double tolerance = std::numeric_limits<double>::infinity();

  // Of an IMU.
  /// index into links, of the one that it is fixed to
  int link = -1;
  int base = 0;                                            ///< CAN id added to the factory's
  double tick = 1e-4;                                      ///< [s] unit of its SampleTime
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< its axes in the link's
  double acceleration_sd = 0;                              ///< [m/s^2] > 0
  double rate_bias_sd = 0;                                 ///< [rad/s] >= 0
  double acceleration_bias_sd = 0;                         ///< [m/s^2] >= 0

  /// position_sd and velocity_sd of an IMU: of the angle and of the rate of turn. Jerks, impacts
  /// and steps of the acceleration are the joint's.
  NoiseDescription noise = {};
};

/// The [[sensor]] tables. Thread-safe.
/// @param robot with links, joints and buses. @throws ConfigError
std::vector<SensorDescription> ReadSensors(Config& root, const RobotDescription& robot);

}  // namespace plumb
