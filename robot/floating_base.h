#pragma once

#include <Eigen/Core>
#include <vector>

#include "robot/description.h"
#include "robot/imu_mounting.h"
#include "robot/kinematics.h"

namespace plumb {

/// The free base of a robot: between the world and the link that carries its IMU are joints with
/// neither motor nor encoder. In an upright plane they are two that slide at right angles and a
/// last one that turns about the plane's normal; in space three that slide at right angles and a
/// last one that is spherical. Plain data.
struct FloatingBase {
  static constexpr int kMaxPoints = 32;  ///< that can touch the ground

  size_t imu;                              ///< index into sensors
  int link;                                ///< index into links: what carries the IMU
  std::vector<ImuMounting::Slide> slides;  ///< with their directions in the world
  int turned;                              ///< index into joints of the last one
  bool spatial;                            ///< that one is spherical
  /// that it turns about, in the link's axes; of no meaning in space
  Eigen::Vector3d axis;
  Pose zero;  ///< of the link where all these joints are at zero

  /// Whether a joint is one of them.
  bool Has(int joint) const;
  /// Of the plane, in the world; not in space.
  Eigen::Vector3d normal() const { return zero.rotation * axis; }
};

/// The free base that the robot's first IMU is on. Thread-safe.
/// @throws std::invalid_argument saying what is missing: an IMU, such joints, points that can touch
/// the ground.
FloatingBase FloatingBaseOf(const RobotDescription& robot);

}  // namespace plumb
