#pragma once

#include "drivers/can/transport.h"

namespace plumb {

/// A bus within the process, for tests. Frames are there as soon as they are sent, stamped with
/// CLOCK_REALTIME or, once their sender has been told the time by SetTime, with that: virtual time,
/// the same in every run. For delays and losses open faulty:...:loop:NAME. Opening, closing, Send
/// and Receive of transports of one name are safe from different threads; one transport is not.
std::unique_ptr<Transport> OpenLoop(const std::string& name, std::vector<Filter> filters);

}  // namespace plumb
