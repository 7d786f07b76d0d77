#pragma once

#include <Eigen/Core>
#include <vector>

#include "robot/description.h"
#include "robot/kinematics.h"

namespace plumb {

/// Of each link: its visual shapes, or collision shapes where it has none of these; a robot without
/// any shape is a stick figure.
std::vector<std::vector<Shape>> ShapesOf(const RobotDescription& robot);

struct Color {
  double red, green, blue;  ///< 0 to 1
};
/// Of a link, in which it is drawn wherever robots are.
Color ColorOf(const RobotDescription& robot, int link);

/// A solid as seen from the side: the convex outline of its projection, counterclockwise [m].
struct Silhouette {
  int link;
  double depth;  ///< [m] along the line of sight, larger is farther
  std::vector<Eigen::Vector2d> outline;
};

/// The contents of a robot's picture, in two dimensions: across (to the right) and up. Thread-safe.
class Scene {
 public:
  /// @param across the base's axis that points to the right, 0 or 1 (x or y).
  Scene(const RobotDescription& robot, int across);

  /// All solids, the farthest first.
  std::vector<Silhouette> Look(const Eigen::Ref<const Eigen::VectorXd>& q) const;
  /// Where turning joints are.
  std::vector<Eigen::Vector2d> Hinges(const Eigen::Ref<const Eigen::VectorXd>& q) const;

 private:
  Eigen::Vector2d Project(const Eigen::Vector3d& point) const { return {point[across_], point[2]}; }
  std::vector<Eigen::Vector2d> Outline(const Shape& shape, const Eigen::Vector3d& center,
                                       const Eigen::Matrix3d& axes) const;

  const RobotDescription* robot_;
  int across_;
  std::vector<std::vector<Shape>> shapes_;  // per link
};

/// Convex hull, counterclockwise, by Andrew's monotone chain (Inf. Proc. Letters 9, 1979).
std::vector<Eigen::Vector2d> ConvexHull(std::vector<Eigen::Vector2d> points);

}  // namespace plumb
