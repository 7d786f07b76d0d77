#pragma once

#include <string>
#include <vector>

#include "common/process.h"

namespace plumb {

/// The flags of `plumb serve-model`.
struct ServeModelFlags {
  std::string robot;
  std::vector<std::string> logs, tables;  ///< LCM logs, CSV files
  std::string address = "127.0.0.1:4242";
  std::vector<std::string> hosts;  ///< further names by which clients may call this machine
  int threads = 0;                 ///< 0 = one per core
};

/// `plumb serve-model`: what logs say of a robot's parameters (RobotModels), for UM-Bridge's
/// clients, until it is stopped. @return exit status 0.
/// @throws std::invalid_argument or std::runtime_error, one line for people: robot, logs, address.
/// Has threads of its own; call it from one.
int ServeModel(Process& process, const ServeModelFlags& flags);

}  // namespace plumb
