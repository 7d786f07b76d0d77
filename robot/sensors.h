#pragma once

#include <vector>

#include "common/config.h"
#include "robot/description.h"

namespace plumb {

/// The [[sensor]] tables. @param robot with links and joints. @throws ConfigError
std::vector<SensorDescription> ReadSensors(Config& root, const RobotDescription& robot);

}  // namespace plumb
