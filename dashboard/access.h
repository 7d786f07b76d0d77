#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace plumb {

/// Who may look, and who may move the robot, by what a browser says of itself. A page from
/// elsewhere that the person has open, too, must not get at us: neither under a name of its own
/// that leads to this machine (DNS rebinding), nor by a WebSocket, which browsers open to anybody.
/// Thread-safe (immutable).
struct Access {
  std::vector<std::string> hosts;    ///< names by which we may be called, besides localhost
  std::vector<std::string> origins;  ///< of other pages that may talk to us, "https://example.org"
  std::string token;  ///< that whoever wants to arm must have; empty: nobody needs one

  /// @param host the header "Host": see plumb::HostAllowed.
  bool HostAllowed(std::string_view host) const;
  /// @param origin the header "Origin", empty: it is no browser.
  bool OriginAllowed(std::string_view origin, std::string_view host) const;
  /// @param cookies the header "Cookie".
  bool TokenGiven(std::string_view cookies) const;
  bool IsToken(std::string_view text) const;
};

/// What the name of the token's cookie begins with; the port follows.
inline constexpr std::string_view kTokenCookie = "plumb_token";

/// 128 random bits, as hexadecimal digits.
std::string NewToken();

}  // namespace plumb
