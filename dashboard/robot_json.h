#pragma once

#include <string>

#include "robot/description.h"

namespace plumb {

/// What the page has to know of the robot before anything is heard of it, /robot.json of
/// docs/dashboard.md. Thread-safe.
/// @param why_not empty if whoever asks may arm the robot.
std::string RobotJson(const RobotDescription& robot, const std::string& why_not);

}  // namespace plumb
