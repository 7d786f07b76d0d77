#include "dashboard/access.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <sodium.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <stdexcept>

namespace plumb {
namespace {

bool IsNumber(const std::string& address, int family) {
  std::array<unsigned char, sizeof(in6_addr)> ignored;
  return inet_pton(family, address.c_str(), ignored.data()) == 1;
}

/// Host and port of "host:port" or "[host]:port"; no port: empty.
struct HostAndPort {
  std::string host;
  std::string_view port;
  bool bracketed = false;
};
HostAndPort Split(std::string_view text) {
  HostAndPort parts;
  size_t end = text.find(':');
  if (text.starts_with('[')) {
    parts.bracketed = true;
    end = text.find(']');
    parts.host = text.substr(1, end == std::string_view::npos ? end : end - 1);
    end = end == std::string_view::npos ? end : text.find(':', end);
  } else {
    parts.host = text.substr(0, end);
  }
  if (end != std::string_view::npos) parts.port = text.substr(end + 1);
  std::ranges::transform(parts.host, parts.host.begin(), [](unsigned char c) {
    return static_cast<char>(std::tolower(c));
  });
  return parts;
}

}  // namespace

ListenAddress ListenAddress::Parse(const std::string& text) {
  const auto refuse = [&](const char* why) {
    throw std::invalid_argument(
        fmt::format("'{}' is no ADDRESS:PORT such as 127.0.0.1:8765: {}", text, why));
  };
  const HostAndPort parts = Split(text);
  ListenAddress listen;
  if (parts.host == "localhost") {
    listen.address = "127.0.0.1";
  } else if (!parts.host.empty()) {
    listen.address = parts.host;
    if (!IsNumber(parts.host, parts.bracketed ? AF_INET6 : AF_INET))
      refuse("the address must be a number, or localhost");
  }
  if (!parts.port.empty()) {
    const char* const end = parts.port.data() + parts.port.size();
    const auto [last, error] = std::from_chars(parts.port.data(), end, listen.port);
    if (error != std::errc() || last != end) refuse("the port must be 0 to 65535");
  }
  return listen;
}

bool ListenAddress::local() const { return address.starts_with("127.") || address == "::1"; }

bool Access::HostAllowed(std::string_view header) const {
  const HostAndPort parts = Split(header);
  if (parts.bracketed ? IsNumber(parts.host, AF_INET6) : IsNumber(parts.host, AF_INET)) return true;
  return parts.host == "localhost" || std::ranges::find(hosts, parts.host) != hosts.end();
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
    if (equals != std::string_view::npos && cookie.substr(0, equals) == kTokenCookie &&
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
