#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "robot/description.h"
#include "sim/view/scene.h"

namespace plumb {

/// A robot as foxglove.SceneUpdate in JSON: Foxglove and Lichtblick draw it in three dimensions
/// without a URDF, and so does the dashboard's page. Entities "ground", "robot" and, translucent,
/// "prediction", of cubes, spheres and cylinders (capsules are these) in the frame "world", which
/// is the base's. The frame "robot" goes with it along the ground, for those who watch it.
/// Thread-safe.
class SceneUpdate {
 public:
  explicit SceneUpdate(const RobotDescription& robot);

  /// @param utime [us] @param q measured, as in RobotDescription. @param prediction what a
  /// simulator says that q is; null: nothing is known, and none is drawn.
  /// @throws std::invalid_argument if one has the wrong size.
  std::string Json(int64_t utime, const Eigen::VectorXd& q,
                   const Eigen::VectorXd* prediction = nullptr) const;

  /// Where the frame "robot" is in "world": below the first link that is seen, unturned.
  /// foxglove.FrameTransform in JSON. @param utime, q as above. @throws as above.
  std::string FrameJson(int64_t utime, const Eigen::VectorXd& q) const;

  /// JSON Schema of the parts that are used.
  static std::string Schema();
  static std::string FrameSchema();

 private:
  Eigen::Vector3d Place(const std::vector<Pose>& poses) const;

  const RobotDescription robot_;
  const std::vector<std::vector<Shape>> shapes_;  // per link
  std::vector<Color> colors_;
};

}  // namespace plumb
