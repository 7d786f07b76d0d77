#pragma once

#include <string>

#include "robot/description.h"

namespace plumb {

/// The outcome of simulating a robot.
struct SimulatorOutcome {
  std::string refusal;  ///< the simulator's reason not to be built; empty if it was
  bool finite = true;   ///< the state in the end
};

/// Builds a simulator of the robot, puts it at the task's target and moves it a little. Throws
/// nothing, as the simulator must not: whatever comes through is a mistake of its.
SimulatorOutcome Simulate(const RobotDescription& robot);

}  // namespace plumb
