#pragma once

#include <vector>

#include "common/config.h"
#include "robot/description.h"
#include "robot/urdf.h"

namespace plumb {

/// Adds what the [[joint]] tables say to the URDF's joints: motors and dynamics. Then every joint
/// is passive or has a motor, and moves some inertia. @throws ConfigError
void ReadJoints(Config& root, UrdfModel& urdf);

/// [task], with its tables of joints.
TaskSettings ReadTask(Config config, const std::vector<JointDescription>& joints);

}  // namespace plumb
