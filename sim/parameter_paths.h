#pragma once

#include <cstddef>
#include <set>
#include <string>
#include <vector>

#include "robot/description.h"
#include "sim/dynamics/physics.h"

namespace plumb {

// Functions here are pure: thread-safe.

/// A parameter that a robot's simulator has: its path, and where in the physics its value goes.
struct ParameterPath {
  std::string path;
  Range values;  ///< that it may have
  // Exactly one of these is not null; none is for what has no effect, the base's mass.
  const WorldParameterKind* world = nullptr;
  const JointParameterKind* joint = nullptr;
  const LinkParameterKind* link = nullptr;
  bool effective() const { return world || joint || link; }

  size_t index = 0;      ///< of the joint that moves the link, or of the joint's first velocity
  size_t count = 1;      ///< of the joint's velocities
  double reference = 1;  ///< of a link's mass or length: what the files imply
};

/// All of them.
/// @param physics of the description's own numbers.
std::vector<ParameterPath> ParameterPaths(const RobotDescription& description,
                                          const Physics<double>& physics);

/// The one of that name, or all that it covers (robot/parameters.h) and that are not in `named`:
/// those that another parameter names in full, and that have an effect.
/// @throws std::invalid_argument naming the nearest if there is none, if they are of several kinds,
/// and, if it is known, the place in the robot's file.
std::vector<ParameterPath> FindPaths(const std::vector<ParameterPath>& paths,
                                     const std::string& name, const std::set<std::string>& named,
                                     const RobotDescription& description);

}  // namespace plumb
