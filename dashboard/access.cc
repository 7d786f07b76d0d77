#include "dashboard/access.h"

#include <fmt/format.h>
#include <sodium.h>

#include <algorithm>
#include <array>
#include <stdexcept>

#include "common/listen_address.h"

namespace plumb {
bool Access::HostAllowed(std::string_view header) const {
  return plumb::HostAllowed(header, hosts);
}

bool Access::OriginAllowed(std::string_view origin, std::string_view host) const {
  if (origin.empty() || std::ranges::find(origins, origin) != origins.end()) return true;
  return origin == "http://" + std::string(host) || origin == "https://" + std::string(host);
}

bool Access::TokenGiven(std::string_view cookies) const {
  if (token.empty()) return true;
  while (!cookies.empty()) {
    const size_t end = std::min(cookies.find(';'), cookies.size());
    std::string_view cookie = cookies.substr(0, end);
    cookies.remove_prefix(std::min(end + 1, cookies.size()));
    while (cookie.starts_with(' ')) cookie.remove_prefix(1);
    const size_t equals = cookie.find('=');
    if (equals != std::string_view::npos && cookie.substr(0, equals).starts_with(kTokenCookie) &&
        IsToken(cookie.substr(equals + 1)))
      return true;
  }
  return false;
}

/// In a time that does not tell how much of it was right.
bool Access::IsToken(std::string_view text) const {
  return text.size() == token.size() && sodium_memcmp(text.data(), token.data(), text.size()) == 0;
}

std::string NewToken() {
  if (sodium_init() < 0) throw std::runtime_error("libsodium cannot be used");
  std::array<unsigned char, 16> bits;
  randombytes_buf(bits.data(), bits.size());
  std::string text;
  for (const unsigned char byte : bits) text += fmt::format("{:02x}", byte);
  return text;
}

}  // namespace plumb
