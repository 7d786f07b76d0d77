#pragma once

#include <Eigen/Core>
#include <vector>

#include "robot/description.h"

namespace plumb {

/// Where a link is, in the base's frame.
struct Pose {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< link axes in the base's
  Eigen::Vector3d position = Eigen::Vector3d::Zero();      ///< [m] of the link's origin
};

/// Poses of all links, links[0] (the base) first. For pictures: the simulator has its own, faster kinematics.
/// @param q as in RobotDescription; a spherical joint's quaternion need not be normalised.
/// @throws std::invalid_argument if q has the wrong size.
std::vector<Pose> LinkPoses(const RobotDescription& description, const Eigen::Ref<const Eigen::VectorXd>& q);

}  // namespace plumb
