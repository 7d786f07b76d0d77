#pragma once

#include <string>
#include <vector>

#include "calibrator/motion/log.h"
#include "robot/description.h"

namespace plumb {

/// What --log and --csv name, in that order. Thread-safe but for the files.
/// @throws std::invalid_argument if they name nothing; std::runtime_error naming the file.
std::vector<Log> ReadLogs(const std::vector<std::string>& logs,
                          const std::vector<std::string>& tables, const RobotDescription& robot);

/// Says on the terminal how many transitions each has, and what of it could not be used.
void PrintLogs(const std::vector<Log>& logs);

}  // namespace plumb
