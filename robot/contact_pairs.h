#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

#include "robot/description.h"

namespace plumb {

/// A shape as all that is within `radius` of a box: one without size for a sphere, of one dimension
/// for a capsule. Cylinders and meshes are none of these. Plain data.
struct RoundedBox {
  Eigen::Vector3d half = Eigen::Vector3d::Zero();  ///< [m] half its edges, in the shape's axes
  double radius = 0;                               ///< [m]
  explicit RoundedBox(const Shape& shape);
};

/// Collision shapes of different links that can touch each other. The base's do not move: steps and
/// slopes. Plain data.
struct ContactPairs {
  struct Solid {
    int link;      ///< index into links
    size_t shape;  ///< index into its collisions
    bool operator==(const Solid&) const = default;
    bool operator<(const Solid& other) const {
      return std::pair(link, shape) < std::pair(other.link, other.shape);
    }
  };
  std::vector<Solid> solids;                     ///< those that are in a pair, in order
  std::vector<std::pair<size_t, size_t>> pairs;  ///< of solids, the first one's link before the
                                                 ///< second one's
};

/// Those of the links that [[simulation.contact.pair]] names: all their spheres, capsules and
/// boxes. Links that a joint joins do not touch each other, unless one of them is the base. None
/// without [simulation.contact]. Thread-safe.
/// @throws ConfigError with the place of a pair that names no two such links, or if there are too
/// many.
ContactPairs FindContactPairs(const RobotDescription& robot);

}  // namespace plumb
