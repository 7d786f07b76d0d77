#pragma once

#include <string>
#include <vector>

#include "robot/description.h"

namespace plumb {

/// What the entries of a robot's q and v are called: as their joint, those of a spherical one with
/// "/w", "/x", "/y" and "/z" of its quaternion and "/x", "/y" and "/z" of its rate. Plain data.
struct CoordinateNames {
  explicit CoordinateNames(const RobotDescription& robot);

  std::vector<std::string> q, v;  ///< num_positions and num_velocities names
};

}  // namespace plumb
