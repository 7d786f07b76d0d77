#pragma once

#include <cstdint>
#include <string>

#include "common/process.h"

namespace plumb {

/// `plumb arm`, `disarm` and `estop`: sends a request and prints the driver's answer. A stop goes
/// out at once and again and again; arming is asked for once, when the driver has been heard,
/// because one wish must not be granted later than it was made. Waits three seconds at most. Not
/// thread-safe.
/// @param request a constant of driver_request_t. @param key file of the key to sign with; empty =
/// unsigned.
/// @return exit status: 0, 1 if the driver has not obeyed, 130 if interrupted.
/// @throws std::runtime_error if the key cannot be read.
int RequestDriver(Process& process, int8_t request, const std::string& key);

}  // namespace plumb
