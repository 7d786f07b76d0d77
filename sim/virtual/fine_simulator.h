#pragma once

#include <memory>

#include "robot/description.h"
#include "sim/virtual/physics_backend.h"

namespace plumb {

/// The physics of a virtual robot by a Simulator in finer steps than any that calibrates: leapfrog,
/// substeps a tenth as long and at most kLongestSubstep, no bound on speeds, the ground as stiff as
/// UnmodelledGround says.
/// @param robot with known parameters, see Model::Describe. Thread-safe.
/// @throws std::invalid_argument if it cannot be simulated.
std::unique_ptr<PhysicsBackend> MakeFineSimulator(const RobotDescription& robot);

inline constexpr double kLongestSubstep = 1e-4;  ///< [s]

}  // namespace plumb
