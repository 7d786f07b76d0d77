#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace plumb {

/// The rotation by roll about x, then pitch about y, then yaw about z, all of them axes that stay
/// where they are; as a URDF's rpy, but not to the last bit what its reader makes of one
/// (robot/urdf/elements.cc). Thread-safe.
/// @param rpy [rad]
inline Eigen::Quaterniond FromRollPitchYaw(const Eigen::Vector3d& rpy) {
  return Eigen::AngleAxisd(rpy.z(), Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(rpy.y(), Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(rpy.x(), Eigen::Vector3d::UnitX());
}

}  // namespace plumb
