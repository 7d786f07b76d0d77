#pragma once

#include "drivers/can/transport.h"

namespace plumb {

/// Linux SocketCAN, classic and FD frames.
/// @param interface such as "can0"; it may be down, link() then says so.
/// @throws std::runtime_error with the cure: no CAN in the kernel, no such interface, not a CAN
/// interface. The transport is not thread-safe.
std::unique_ptr<Transport> OpenSocketCan(const std::string& interface, std::vector<Filter> filters);

}  // namespace plumb
