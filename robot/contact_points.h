#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

#include "robot/description.h"

namespace plumb {

/// Where a shape can touch the ground: centres [m] of spheres in the link frame and their radii. A
/// sphere and the ends of a capsule are spheres, the corners of a box and of a mesh's hull have
/// radius zero; a cylinder's rim is not one of them. Thread-safe.
std::vector<std::pair<Eigen::Vector3d, double>> ContactSpheres(const Shape& shape);

/// A sphere on a link that can touch the ground.
struct ContactPoint {
  int link;                ///< index into links
  Eigen::Vector3d centre;  ///< [m] in the link frame
  double radius;           ///< [m] >= 0
};

/// Those of all collision shapes, link by link: the order of ROBOT_STATE's contacts and of the
/// simulator. None if the robot does not touch the ground ([simulation.contact] is missing).
/// Thread-safe.
std::vector<ContactPoint> ContactPoints(const RobotDescription& robot);

}  // namespace plumb
