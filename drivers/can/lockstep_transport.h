#pragma once

#include <memory>
#include <string>
#include <vector>

#include "drivers/can/transport.h"

namespace plumb {

/// A bus in a run in virtual time (docs/virtual-time.md). Frames are sent on the bus itself, where
/// candump and python-can see them, and received from it; but when, and in which order, the run's
/// coordinator says. So they are dated with virtual time and come in the same order in every run.
/// One that does not arrive ends the run with its name and number. What somebody outside the run
/// sends is not handed out; the first such frame is noted.
///
/// Receive may block, for a frame that is said to have been sent and has not arrived yet.
/// @param url what the bus is called in the run. @param bus null: there is no other than the
/// coordinator's. The transport is not thread-safe.
std::unique_ptr<Transport> OpenLockstep(const std::string& url, std::unique_ptr<Transport> bus,
                                        std::vector<Filter> filters, LockstepBus run);

}  // namespace plumb
