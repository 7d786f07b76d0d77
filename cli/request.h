#pragma once

#include <cstdint>
#include <string>

#include "common/process.h"

namespace plumb {

/// `plumb arm`, `disarm` and `estop`: sends a request, signed where the process has a key, and
/// prints the driver's answer to it. A stop goes out at once and again and again; arming is asked
/// for once, when the driver has been heard, because one wish must not be granted later than it was
/// made. Waits three seconds at most. Not thread-safe.
/// @param request a constant of driver_request_t.
/// @return exit status: 0 the driver has answered, and done it; 1 if not; 130 if interrupted.
int RequestDriver(Process& process, int8_t request);

}  // namespace plumb
