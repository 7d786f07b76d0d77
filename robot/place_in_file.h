#pragma once

#include <string>

#include "robot/description.h"

namespace plumb {

/// "file:line:column: " of `key` in the entry of that name of the robot's [[table]], for what is
/// found to be wrong only when the robot has been read. Empty if the file has no such entry, or
/// there is no file; "file: " if it cannot be read any more. Reads the file again. Thread-safe but
/// for the files.
std::string PlaceInFile(const RobotDescription& robot, const std::string& table,
                        const std::string& name, const std::string& key);

}  // namespace plumb
