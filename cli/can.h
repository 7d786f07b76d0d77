#pragma once

#include <string>

namespace plumb {

/// `plumb can plan ROBOT`: prints the messages on each of the robot's buses, its load and the
/// response times. Thread-safe, like WriteDbc. @return exit status: 1 if a bus cannot work.
/// @throws std::invalid_argument or ConfigError if there is no such robot.
int PrintBusPlan(const std::string& robot);

/// `plumb can dbc ROBOT`: writes the DBC file (see drivers/bus/dbc.h). @param bus name of one of
/// the robot's buses; "" = its only one. @param output file; "" = standard output.
/// @return exit status. @throws std::invalid_argument, too, if the robot has no such bus, or is
/// read from that file.
int WriteDbc(const std::string& robot, const std::string& bus, const std::string& output);

}  // namespace plumb
