#include "common/listen_address.h"

#include <arpa/inet.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <stdexcept>

#include "common/small_letters.h"

namespace plumb {

HostAndPort HostAndPort::Split(std::string_view text) {
  HostAndPort parts;
  const size_t bracket = text.starts_with('[') ? text.find(']') : std::string_view::npos;
  parts.bracketed = bracket != std::string_view::npos;
  const size_t end = text.find(':', parts.bracketed ? bracket : 0);
  parts.host = InSmallLetters(text.substr(0, end));
  if (parts.bracketed) parts.host = parts.host.substr(1, parts.host.size() - 2);
  if (end != std::string_view::npos) parts.port = text.substr(end + 1);
  return parts;
}

bool HostAndPort::is_number() const {
  std::array<unsigned char, sizeof(in6_addr)> ignored;
  return inet_pton(bracketed ? AF_INET6 : AF_INET, host.c_str(), ignored.data()) == 1;
}

ListenAddress ListenAddress::Parse(const std::string& text) {
  const auto refuse = [&](const char* why) {
    throw std::invalid_argument(
        fmt::format("'{}' is no ADDRESS:PORT such as 127.0.0.1:8765: {}", text, why));
  };
  const HostAndPort parts = HostAndPort::Split(text);
  ListenAddress listen;
  if (!parts.host.empty() && parts.host != "localhost") {
    if (!parts.is_number()) refuse("the address must be a number, or localhost");
    listen.address = parts.host;
  }
  if (!parts.port.empty()) {
    const char* const end = parts.port.data() + parts.port.size();
    const auto [last, error] = std::from_chars(parts.port.data(), end, listen.port);
    if (error != std::errc() || last != end) refuse("the port must be 0 to 65535");
  }
  return listen;
}

bool ListenAddress::local() const { return address.starts_with("127.") || address == "::1"; }

bool HostAllowed(std::string_view header, const std::vector<std::string>& names) {
  const HostAndPort parts = HostAndPort::Split(header);
  const bool port = std::ranges::all_of(parts.port, [](char c) { return c >= '0' && c <= '9'; });
  if (!port) return false;
  return parts.is_number() || parts.host == "localhost" ||
         std::ranges::find(names, parts.host) != names.end();
}

}  // namespace plumb
