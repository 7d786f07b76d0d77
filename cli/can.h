#pragma once

#include <string>

namespace plumb {

/// `plumb can plan ROBOT`: prints what is on the robot's bus, how full it is and how late it may
/// get.
/// @return exit status: 1 if it cannot work.
int PrintBusPlan(const std::string& robot);

/// `plumb can dbc ROBOT`: writes the DBC file (see drivers/bus/dbc.h). @param output file; "" =
/// standard output.
/// @return exit status
int WriteDbc(const std::string& robot, const std::string& output);

}  // namespace plumb
