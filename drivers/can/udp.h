#pragma once

#include "drivers/can/transport.h"

namespace plumb {

/// A bus made of UDP multicast datagrams, one frame each, in the format of python-can's
/// "udp_multicast" interface (see udp_codec.h). Datagrams stay on this machine (TTL 0), and those
/// of other machines are not received. Nothing arbitrates, acknowledges or limits the rate; frames
/// are lost only when a receiver is too slow.
/// @param address "GROUP:PORT", an IPv4 multicast group.
/// @throws std::runtime_error with the cure. The transport is not thread-safe.
std::unique_ptr<Transport> OpenUdp(const std::string& address, std::vector<Filter> filters,
                                   bool told_time = false);

}  // namespace plumb
