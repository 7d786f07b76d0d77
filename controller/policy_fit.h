#pragma once

#include "controller/policy.h"
#include "robot/description.h"
#include "sim/tasks/task.h"

namespace plumb {

/// @throws std::invalid_argument if the policy is for another robot or task, by its numbers of
/// observations and actions, or for other effort limits than the robot's, by 1e-4 of them: an
/// action of 1 would be another effort. Thread-safe.
void RequireFit(const GaussianPolicy& policy, const RobotDescription& robot, const Task& task);

}  // namespace plumb
