#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

namespace plumb {

/// The rotation about a vector, by its length. Thread-safe.
/// @param vector [rad] of any length
inline Eigen::Quaterniond FromRotationVector(const Eigen::Vector3d& vector) {
  const double angle = vector.norm();
  // Below this its sine is the angle, to the last bit.
  if (angle < 1e-9) {
    return Eigen::Quaterniond(1, vector.x() / 2, vector.y() / 2, vector.z() / 2).normalized();
  }
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, vector / angle));
}

/// The shortest of a rotation's vectors. Thread-safe.
/// @param rotation not 0; need not be of length 1
/// @return [rad] of a length of pi at most
inline Eigen::Vector3d ToRotationVector(const Eigen::Quaterniond& rotation) {
  const double sine = rotation.vec().norm(), cosine = std::abs(rotation.w());
  if (sine == 0) return 2 * rotation.vec();  // or NaN
  return std::copysign(2 * std::atan2(sine, cosine), rotation.w()) / sine * rotation.vec();
}

}  // namespace plumb
