#include "common/lcm_url.h"

#include <arpa/inet.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace plumb {
namespace {

constexpr char kUdpm[] = "udpm://";
constexpr char kDefaultGroup[] = "239.255.76.67";  // of liblcm

std::string Resolved(const std::string& url) {
  const char* environment = std::getenv("LCM_DEFAULT_URL");
  return url.empty() && environment ? environment : url;
}

}  // namespace

bool StaysOnMachine(const std::string& url) {
  const std::string resolved = Resolved(url);
  if (resolved.empty() || resolved.starts_with("memq://") || resolved.starts_with("file://"))
    return true;
  if (!resolved.starts_with(kUdpm)) return false;
  // liblcm takes the last of several; we want all of them to be plainly 0.
  for (size_t at = resolved.find_first_of("?&"); at != std::string::npos;
       at = resolved.find_first_of("?&", at + 1)) {
    const std::string option =
        resolved.substr(at + 1, resolved.find_first_of("?&", at + 1) - at - 1);
    if (option == "ttl" || (option.starts_with("ttl=") && option != "ttl=0")) return false;
  }
  return true;
}

std::vector<std::string> OpenInterfaces(const std::string& url) {
  const std::string resolved = Resolved(url);
  if (!resolved.empty() && !resolved.starts_with(kUdpm)) return {};
  std::string address = resolved.substr(std::min(resolved.size(), sizeof kUdpm - 1));
  address.erase(std::min(address.size(), address.find_first_of(":?")));
  in_addr group{};
  if (inet_pton(AF_INET, address.empty() ? kDefaultGroup : address.c_str(), &group) != 1) return {};
  // A line for an interface, "2 eth0 : ...", then an indented one for each of its groups, in the
  // order of memory.
  const std::string wanted = fmt::format("{:08X}", group.s_addr);
  std::vector<std::string> interfaces;
  std::ifstream table("/proc/net/igmp");
  std::string interface;
  for (std::string line; std::getline(table, line);) {
    std::istringstream words(line);
    std::string first, second;
    words >> first >> second;
    if (!line.empty() && line[0] != '\t')
      interface = second;
    else if (first == wanted && interface != "lo")
      interfaces.push_back(interface);
  }
  return interfaces;
}

void RequireKey(const std::string& url, bool key, bool allow_unsigned) {
  if (key || allow_unsigned || StaysOnMachine(url)) return;
  throw std::invalid_argument(fmt::format(
      "LCM at {} leaves this machine: anybody on the network could command the robot; cure: "
      "--key FILE (plumb key "
      "FILE makes one), or --unsigned to allow just that",
      Resolved(url)));
}

}  // namespace plumb
