#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

namespace plumb {

// What waits in this machine's kernel for those who listen to a UDP port, and what they have lost.
// Thread-safe.

struct ReceiveQueue {
  uint64_t socket;  ///< its inode, which no other socket has at the time
  size_t waiting;   ///< [bytes] of the kernel's memory, more than the datagrams have
  uint64_t drops;   ///< datagrams that found no room, since the socket was opened
  bool operator==(const ReceiveQueue&) const = default;
};

/// Of all sockets of this network namespace that are bound to the port, whatever their address.
/// Empty where the kernel does not tell.
std::vector<ReceiveQueue> ReceiveQueues(uint16_t port);
/// The same of a text as /proc/net/udp has it. Lines that are none of its are passed over.
std::vector<ReceiveQueue> ParseReceiveQueues(std::string_view text, uint16_t port);

}  // namespace plumb
