#pragma once

#include <memory>

#include "robot/description.h"
#include "sim/virtual/physics_backend.h"

namespace plumb {

/// MuJoCo as what moves a robot: see Mjcf. It goes in steps of its Runge-Kutta method as long as
/// from one event to the next, and 2 ms, gym's, at most, or a tenth of a contact's softness, which
/// is in seconds there: so that it is exact to the microsecond when it is looked at, and nothing is
/// interpolated.
/// @throws std::invalid_argument if MuJoCo is not part of this build, or cannot be told what the
/// robot is.
std::unique_ptr<PhysicsBackend> MakeMujocoBackend(const RobotDescription& robot);

/// Whether MuJoCo is part of this build. Functions here are thread-safe.
bool HasMujoco();

}  // namespace plumb
