#pragma once

#include <string>
#include <vector>

#include "robot/description.h"

namespace plumb {

/// Whether a log can be of this robot, by the description that `plumb launch` and `plumb record`
/// put beside it, LOG.d/robot.toml: messages number the joints, so another robot's would be taken
/// for this one's. Other TOML files of the robot differ in anything but the joints. Where there is
/// no such description, or it cannot be read (an older version's), nothing is known.
/// @return for people: what is doubtful, the robot's name being the same and its joints not.
/// @throws std::runtime_error "log: is a log of ..." if both are others. Thread-safe.
std::vector<std::string> CheckRecordedRobot(const std::string& log, const RobotDescription& robot);

}  // namespace plumb
