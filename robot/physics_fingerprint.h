#pragma once

#include <cstdint>

#include "robot/description.h"

namespace plumb {

/// FNV-1a over all that the numbers of a parameter distribution refer to: links, joints and their
/// dynamics, contact shapes, frozen parameters and the simulation's settings. Unlike
/// RobotDescription::fingerprint it does not change with comments, pictures, motors' addresses,
/// priors or the settings of tasks and training. Thread-safe.
uint64_t PhysicsFingerprint(const RobotDescription& robot);

}  // namespace plumb
