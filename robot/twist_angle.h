#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

namespace plumb {

/// The angle of a rotation's twist about an axis, of its decomposition into a swing across the axis
/// and a twist about it. Thread-safe.
/// @param axis unit vector; a twist about it leaves it as it is.
/// @return [rad] in [-2 pi, 2 pi]: the two quaternions of a rotation give angles that are a whole
/// turn apart.
inline double TwistAngle(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& axis) {
  return 2 * std::atan2(axis.dot(rotation.vec()), rotation.w());
}

}  // namespace plumb
