#include "common/lcm_url.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <limits>
#include <set>
#include <stdexcept>
#include <string_view>

namespace plumb {
namespace {

constexpr char kUdpm[] = "udpm://";

int NumberIn(const std::string& url, std::string_view what, std::string_view text, int least,
             int greatest) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < least ||
      value > greatest) {
    throw std::invalid_argument(
        fmt::format("{}: '{}' is no {}: {} to {} are", url, text, what, least, greatest));
  }
  return value;
}

}  // namespace

std::string ResolvedLcmUrl(const std::string& url) {
  if (!url.empty()) return url;
  const char* environment = std::getenv("LCM_DEFAULT_URL");
  return environment && *environment ? environment : kDefaultLcmUrl;
}

MulticastAddress ParseUdpm(const std::string& url) {
  std::string_view rest = url;
  if (!rest.starts_with(kUdpm)) throw std::invalid_argument(url + ": not a udpm: URL");
  rest.remove_prefix(sizeof kUdpm - 1);
  // Liblcm's own, where the URL says nothing.
  MulticastAddress address{"239.255.76.67", 7667};
  const std::string_view network = rest.substr(0, rest.find_first_of("?&"));
  rest.remove_prefix(network.size());
  const size_t colon = network.find(':');
  if (!network.empty()) address.group = network.substr(0, colon);
  if (colon != std::string_view::npos) {
    address.port = static_cast<uint16_t>(
        NumberIn(url, "port", network.substr(colon + 1), 1, std::numeric_limits<uint16_t>::max()));
  }
  in_addr group{};
  if (inet_pton(AF_INET, address.group.c_str(), &group) != 1 || !IN_MULTICAST(ntohl(group.s_addr)))
    throw std::invalid_argument(fmt::format(
        "{}: '{}' is no IPv4 multicast group, such as 239.255.76.67", url, address.group));
  for (std::set<std::string_view> seen; !rest.empty();) {
    rest.remove_prefix(1);
    const std::string_view option = rest.substr(0, rest.find_first_of("?&"));
    rest.remove_prefix(option.size());
    const size_t equals = std::min(option.find('='), option.size());
    const std::string_view key = option.substr(0, equals),
                           value = option.substr(std::min(equals + 1, option.size()));
    if (!seen.insert(key).second)
      throw std::invalid_argument(fmt::format("{}: '{}' is given twice", url, key));
    if (key == "ttl")
      address.ttl = NumberIn(url, "ttl", value, 0, 255);
    else if (key == "recv_buf_size")
      address.receive_buffer =
          NumberIn(url, "recv_buf_size", value, 0, std::numeric_limits<int>::max());
    else
      throw std::invalid_argument(
          fmt::format("{}: '{}' is no option of udpm: ttl and recv_buf_size are", url, key));
  }
  return address;
}

std::string LcmGroup(const std::string& url) {
  if (!url.starts_with(kUdpm)) return url;
  const MulticastAddress address = ParseUdpm(url);
  in_addr group{};
  inet_pton(AF_INET, address.group.c_str(), &group);
  return fmt::format("{:08x}:{}", ntohl(group.s_addr), address.port);
}

bool StaysOnMachine(const std::string& url) {
  const std::string resolved = ResolvedLcmUrl(url);
  if (resolved.starts_with("memq://") || resolved.starts_with("file://")) return true;
  if (!resolved.starts_with(kUdpm)) return false;
  try {
    return ParseUdpm(resolved).ttl == 0;
  } catch (const std::invalid_argument&) {
    return false;
  }
}

void RequireKey(const std::string& url, bool key, bool allow_unsigned) {
  if (key || allow_unsigned || StaysOnMachine(url)) return;
  throw std::invalid_argument(fmt::format(
      "LCM at {} leaves this machine: anybody on the network could command the robot; cure: "
      "--key FILE (plumb key "
      "FILE makes one), or --unsigned to allow just that",
      ResolvedLcmUrl(url)));
}

}  // namespace plumb
