#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "robot/description.h"

namespace plumb {

/// Where a link is, how its joint moves it, and how it would accelerate if no joint did. World axes.
struct LinkMotion {
  Eigen::Matrix3d rotation;  ///< link axes in world axes
  Eigen::Vector3d position;  ///< [m] of the link's origin
  Eigen::Vector3d axis;      ///< angular velocity per unit of joint velocity
  Eigen::Vector3d slide;  ///< velocity per unit of joint velocity of the link's point at the world's origin
  Eigen::Vector3d angular_velocity;  ///< [rad/s]
  Eigen::Vector3d angular_bias;      ///< [rad/s^2] angular acceleration at zero joint accelerations
  Eigen::Vector3d linear_bias;  ///< [m/s^2] acceleration of the link's origin at zero joint accelerations
};

/// Kinematics of a tree of one-degree-of-freedom joints, by Simbody. Only a matter subsystem, with its own
/// State that is written in place: no force subsystem, no System::realize, no allocation. Not thread-safe;
/// instances share nothing.
class Tree {
 public:
  /// @throws std::invalid_argument unless every joint's parent link is the base or moved by an earlier joint,
  /// and joint i moves link i + 1.
  explicit Tree(const RobotDescription& description);
  ~Tree();

  /// Index of the joint that moves the parent link of each joint; -1 where that is the base.
  const std::vector<int>& parents() const { return parents_; }

  /// Motion of the link of each joint at finite q, v. Valid until the next call.
  /// Where every joint is on the base, velocities exert no generalised force (a body turning about a fixed
  /// axis, or sliding along one, feels none along its joint), so they are taken as zero to save half of the
  /// time.
  const std::vector<LinkMotion>& Update(const Eigen::VectorXd& q, const Eigen::VectorXd& v);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
  std::vector<int> parents_;
};

}  // namespace plumb
