#pragma once

#include <string>
#include <vector>

#include "robot/buses.h"

namespace plumb {

/// Makes sure, before anything is started, that a run will be alone: listens for half a second to
/// LCM and to the buses. Two runs on one LCM or one bus would command each other's robots; and a
/// robot that already talks on a bus meant for a virtual one is a real one.
/// @param real the robot itself is on the buses. Otherwise they must be such as no real robot can
/// be on: udp: or a vcan interface; or loop:, on which nobody is.
/// Not thread-safe. @throws std::runtime_error or std::invalid_argument, one line that says what to
/// do. Also if a bus cannot be opened.
void RequireFree(const std::string& lcm_url, const std::vector<BusDescription>& buses, bool real);

}  // namespace plumb
