#pragma once

#include <Simbody.h>

#include <vector>

#include "robot/description.h"

namespace plumb {

/// A robot's links, joints and gravity as Simbody has them, before realizeTopology. To be included
/// only by files that are compiled as Simbody's headers ask for, see sim/CMakeLists.txt.
struct SimbodyTree {
  /// Body frames are the URDF's link frames.
  /// @throws std::invalid_argument if the joints do not form a tree; SimTK::Exception::Base if
  /// Simbody refuses the inertias.
  explicit SimbodyTree(const RobotDescription& robot);

  SimTK::MultibodySystem system;  // before its subsystems, which refer to it when destroyed
  SimTK::SimbodyMatterSubsystem matter;
  SimTK::GeneralForceSubsystem forces;
  SimTK::Force::Gravity gravity;
  SimTK::Force::DiscreteForces efforts;
  std::vector<SimTK::MobilizedBody> links;  ///< in order of RobotDescription::links
};

inline SimTK::Vec3 ToSimbody(const Eigen::Vector3d& v) { return {v[0], v[1], v[2]}; }

}  // namespace plumb
