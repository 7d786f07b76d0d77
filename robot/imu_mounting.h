#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "robot/description.h"

namespace plumb {

/// The joints whose motion an IMU on a link measures: from the base up to its link all joints
/// slide, but for the last one, which may turn without a motor. An IMU on any other link measures
/// no joint: turned is -1, and there are no slides. Plain data.
struct ImuMounting {
  /// Index into joints of the one that turns the link: the angle is the twist of the link's
  /// orientation about the joint's axis, indifferent to a wrong heading where the axis is level.
  /// -1: none.
  int turned = -1;
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();  ///< of that joint, in the link's axes
  /// Link's axes -> base's where that joint is at 0.
  Eigen::Quaterniond unturned = Eigen::Quaterniond::Identity();

  /// A joint that slides and the unit vector along which it does, in the base's axes. Those of a
  /// mounting are at right angles: otherwise there are none, since one acceleration could then not
  /// be told from the other.
  struct Slide {
    int joint;
    Eigen::Vector3d direction;
  };
  std::vector<Slide> slides;

  /// [rad] in [-pi, pi] of the turned joint, from the link's orientation.
  double Angle(const Eigen::Quaterniond& link_to_world) const;
};

/// Thread-safe. @param link index into robot.links.
ImuMounting MountingOf(const RobotDescription& robot, int link);

}  // namespace plumb
