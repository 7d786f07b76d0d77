#pragma once

#include <vector>

#include "robot/description.h"

namespace plumb {

/// @throws std::invalid_argument unless joint i moves link i + 1 and hangs on a link before it.
/// Thread-safe.
void RequireTree(const RobotDescription& robot);

/// Joints on the way from the base to a link (0 = the base), in this order. Thread-safe.
std::vector<int> ChainTo(const RobotDescription& robot, int link);

}  // namespace plumb
