#pragma once

#include "robot/description.h"
#include "trainer/rollout.h"

namespace plumb {

/// Makes simulations of the robot's task, which share one model. Thread-safe.
/// @throws std::invalid_argument, when called, as Environment does.
SimulationFactory SimulateRobot(const RobotDescription& description);

}  // namespace plumb
