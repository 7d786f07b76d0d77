#pragma once

#include <string>
#include <vector>

namespace plumb {

/// All functions of this header are thread-safe.

/// True if what is sent to this LCM URL reaches no other machine: memq:, file:, or udpm: with a TTL
/// of 0, which is liblcm's default. An empty URL is what liblcm makes of it: $LCM_DEFAULT_URL, or
/// udpm: with TTL 0.
bool StaysOnMachine(const std::string& url);

/// The network interfaces, the loopback aside, through which this machine receives a udpm: URL's
/// multicast group while somebody on it listens. Whoever is on those networks can send to it,
/// whatever our own TTL is. Read from /proc/net/igmp; empty where there is none.
std::vector<std::string> OpenInterfaces(const std::string& url);

/// Makes sure that commands are signed where others on the network could send some, too.
/// @param key whether there is a key. @param allow_unsigned whether a person has taken the risk.
/// @throws std::invalid_argument, cause and cures, if the URL leaves this machine and neither is
/// so.
void RequireKey(const std::string& url, bool key, bool allow_unsigned);

}  // namespace plumb
