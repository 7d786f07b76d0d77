#pragma once

#include <string>

#include "common/process.h"

namespace plumb {

/// The flags of `plumb record`.
struct RecordFlags {
  std::string log;
  bool overwrite = false;  ///< what the log holds, if it is an LCM log
  std::string robot;       ///< folder or TOML file, to be kept beside it; empty = not known
  std::string note;        ///< what is recorded, for people
  std::string command;     ///< that was given
};

/// `plumb record`: writes every message on LCM, whatever its channel, to a log in lcm-logger's
/// format, until it is asked to stop, and beside it what it takes to understand it (RecordFolder).
/// Not thread-safe.
/// @return exit status. @throws std::runtime_error if a file cannot be written, also later on, or
/// the robot cannot be read; std::invalid_argument in a run in virtual time, which keeps its record
/// itself.
int Record(Process& process, const RecordFlags& flags);

}  // namespace plumb
