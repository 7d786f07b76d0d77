#pragma once

#include <Eigen/Core>
#include <vector>

#include "robot/description.h"

namespace plumb {

/// Of a link in the base's frame.
struct Pose {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< link axes in the base's
  Eigen::Vector3d position = Eigen::Vector3d::Zero();      ///< [m] of the link's origin
};

/// Poses of all links, links[0] (the base) first. For pictures: the simulator has its own, faster
/// kinematics.
/// @param q as in RobotDescription; a spherical joint's quaternion need not be normalised.
/// @throws std::invalid_argument if q has the wrong size. Thread-safe.
std::vector<Pose> LinkPoses(const RobotDescription& description,
                            const Eigen::Ref<const Eigen::VectorXd>& q);

/// Pose and velocity of a link, in the base's axes.
struct LinkMotion : Pose {
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();      ///< [rad/s]
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< [m/s] of the link's origin
};

/// Positions, velocities and Jacobians of points on a robot's links. Does not allocate after
/// construction. Not thread-safe.
class Kinematics {
 public:
  using Vector = Eigen::Ref<const Eigen::VectorXd>;

  explicit Kinematics(const RobotDescription& robot);

  /// @param q, v as in RobotDescription. @throws std::invalid_argument if one has the wrong size.
  void Update(const Vector& q, const Vector& v);

  // All as of the last Update.
  const LinkMotion& link(int index) const { return links_[static_cast<size_t>(index)]; }
  /// [m] of a point [m] of the link's frame, in the base's.
  Eigen::Vector3d Position(int link, const Eigen::Vector3d& point) const;
  /// [m/s] of the same, in the base's axes.
  Eigen::Vector3d Velocity(int link, const Eigen::Vector3d& point) const;
  /// Its velocity per velocity of each coordinate: 3 x num_velocities, written to `jacobian`.
  void Jacobian(int link, const Eigen::Vector3d& point,
                Eigen::Ref<Eigen::Matrix3Xd> jacobian) const;

 private:
  std::vector<JointDescription> joints_;
  Eigen::Index num_positions_, num_velocities_;
  std::vector<Eigen::Index> velocity_index_;  // of each joint's first
  std::vector<LinkMotion> links_;
};

}  // namespace plumb
