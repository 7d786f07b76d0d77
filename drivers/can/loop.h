#pragma once

#include "drivers/can/transport.h"

namespace plumb {

/// A bus within the process, for tests. Opening, closing, Send and Receive of transports of one name are safe
/// from different threads; one transport is not.
std::unique_ptr<Transport> OpenLoop(const std::string& name, std::vector<Filter> filters);

}  // namespace plumb
