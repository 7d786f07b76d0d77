#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace plumb {

/// Where a server listens. Thread-safe, as all functions here.
struct ListenAddress {
  std::string address = "127.0.0.1";  ///< a number, not a name
  uint16_t port = 8765;               ///< 0 = the kernel's choice

  /// "ADDRESS:PORT", "ADDRESS", ":PORT", "[::1]:PORT"; ADDRESS may be "localhost".
  /// @throws std::invalid_argument, one line that says what is wrong.
  static ListenAddress Parse(const std::string& text);
  /// Whether it can only be reached from this machine.
  bool local() const;
};

/// Host, in small letters, and port of "host:port" or "[host]:port". No port: empty.
struct HostAndPort {
  std::string host;
  std::string_view port;   ///< of the text
  bool bracketed = false;  ///< as IPv6's numbers are
  static HostAndPort Split(std::string_view text);
  /// Whether the host is an address of IPv4, or in brackets one of IPv6.
  bool is_number() const;
};

/// Whether whoever asks calls a server by a number, which nobody can rebind, by "localhost" or by
/// one of these names: a page under a name of its own that leads to this machine (DNS rebinding)
/// must not get at it. @param header "Host" of an HTTP request. @param names in small letters.
bool HostAllowed(std::string_view header, const std::vector<std::string>& names);

}  // namespace plumb
