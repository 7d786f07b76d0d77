#pragma once

#include <memory>
#include <string>
#include <vector>

#include "drivers/can/transport.h"

namespace plumb {

/// A bus in a run in virtual time (docs/virtual-time.md). Frames are sent on the bus itself, where
/// candump and python-can see them, and received from it; but when, and in which order, the run's
/// coordinator says. So they are dated with virtual time and come in the same order in every run.
/// A frame that does not arrive ends the run with its name and number. Frames from outside the run
/// are not handed out; the first of them is noted.
///
/// Receive may block, for a frame that is said to have been sent and has not arrived yet.
/// @param url the bus's name in the run. @param bus null: the coordinator alone carries the frames.
/// The transport is not thread-safe.
std::unique_ptr<Transport> OpenLockstep(const std::string& url, std::unique_ptr<Transport> bus,
                                        std::vector<Filter> filters, LockstepBus run);

}  // namespace plumb
