#pragma once

#include <string>

#include "common/process.h"

namespace plumb {

/// `plumb record`: writes every message on LCM, whatever its channel, to a log in lcm-logger's
/// format, until it is asked to stop. Not thread-safe.
/// @return exit status. @throws std::runtime_error if the file cannot be written, also later on;
/// std::invalid_argument in a run in virtual time, which keeps its record itself.
int Record(Process& process, const std::string& file);

}  // namespace plumb
