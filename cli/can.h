#pragma once

#include <string>

namespace plumb {

/// `plumb can plan ROBOT`: prints the messages on the robot's bus, its load and the response times.
/// Thread-safe, like WriteDbc. @return exit status: 1 if the bus cannot work.
/// @throws std::invalid_argument or ConfigError if there is no such robot.
int PrintBusPlan(const std::string& robot);

/// `plumb can dbc ROBOT`: writes the DBC file (see drivers/bus/dbc.h). @param output file; "" =
/// standard output.
/// @return exit status. @throws std::invalid_argument, too, if the robot is read from that file.
int WriteDbc(const std::string& robot, const std::string& output);

}  // namespace plumb
