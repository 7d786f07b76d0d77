#pragma once

#include <cstdint>
#include <string>

namespace plumb {

/// All functions of this header are thread-safe.

/// LCM by multicast on this machine only (TTL 0), with a receive buffer large enough for a policy.
inline constexpr char kDefaultLcmUrl[] = "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=2097152";

/// The channel on which liblcm says something to itself when it starts.
inline constexpr char kSelfTest[] = "LCM_SELF_TEST";

/// The URL itself; for an empty one $LCM_DEFAULT_URL or, without that, kDefaultLcmUrl.
std::string ResolvedLcmUrl(const std::string& url);

/// Where the messages of a udpm: URL go.
struct MulticastAddress {
  std::string group;             ///< IPv4, e.g. "239.255.76.67"
  uint16_t port;                 ///< 1 to 65535
  int ttl = 0;                   ///< 0 to 255; 0 = stays on this machine
  int receive_buffer = 2 << 20;  ///< of the kernel [bytes]; 0 = its default
  bool operator==(const MulticastAddress&) const = default;
};

/// Reads udpm://GROUP:PORT?ttl=N&recv_buf_size=N, in which everything but "udpm://" may be left
/// out. Stricter than liblcm, which takes what it does not understand for 0.
/// @throws std::invalid_argument naming what is wrong.
MulticastAddress ParseUdpm(const std::string& url);

/// Group and port of a udpm: URL, the same however that is spelt; any other URL itself.
/// @throws as ParseUdpm.
std::string LcmGroup(const std::string& url);

/// True if what is sent to this LCM URL reaches no other machine: memq:, file:, or udpm: with a TTL
/// of 0, which is liblcm's default. In udpm: both directions hold: with a TTL of
/// 0 nothing that others send comes in (LcmReceiver).
bool StaysOnMachine(const std::string& url);

/// Makes sure that commands are signed where others on the network could send some, too.
/// @param key whether there is a key. @param allow_unsigned whether a person has taken the risk.
/// @throws std::invalid_argument, cause and cures, if the URL leaves this machine and neither is
/// so.
void RequireKey(const std::string& url, bool key, bool allow_unsigned);

}  // namespace plumb
