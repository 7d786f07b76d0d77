#pragma once

#include "robot/description.h"

namespace plumb {

/// All driven joints and all sensors speak a protocol that is known here. Reads the robot's file
/// again if not. Thread-safe but for the file.
/// @throws std::invalid_argument for the first that does not, naming it, its place in the robot's
/// file and the protocol that may have been meant.
void RequireProtocols(const RobotDescription& robot);

}  // namespace plumb
