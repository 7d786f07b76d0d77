#pragma once

#include <linux/filter.h>

#include <cstdint>
#include <vector>

namespace plumb {

/// liblcm 1.3.1 writes out of bounds when a fragment's offset + length wraps around (lcm-proj/lcm
/// pull request 628): one crafted datagram corrupts memory before any code of ours runs. A classic
/// BPF program on liblcm's receive socket drops such datagrams in the kernel.

/// The program: accepts whole messages ("LC02") whose channel name ends within 64 bytes, and
/// fragments ("LC03") that lie inside a message of at most `max_message` bytes; drops everything
/// else. Thread-safe.
std::vector<sock_filter> LcmGuardProgram(uint32_t max_message);

/// Attaches the program to every UDP socket of this process bound to `port`.
/// @return the number of sockets guarded, -1 if they cannot be listed. Not thread-safe.
int AttachLcmGuard(uint16_t port, uint32_t max_message = 4u << 20);

}  // namespace plumb
