#include "common/lcm_url.h"

#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "common/messenger.h"

namespace plumb {
namespace {

TEST_CASE("which LCM URLs stay on this machine") {
  for (const char* url :
       {kDefaultLcmUrl, "memq://", "file:///tmp/x.log", "udpm://", "udpm://239.255.76.67:7667",
        "udpm://?ttl=0", "udpm://239.255.76.67:7667?recv_buf_size=1&ttl=0",
        "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=1",
        "udpm://239.255.76.67:7667?ttl=0&ttl=0"}) {
    INFO(url);
    CHECK(StaysOnMachine(url));
    CHECK_NOTHROW(RequireKey(url, false, false));
  }
  // liblcm reads numbers as strtol does, in any base, takes the last of several, and has other
  // providers.
  for (const char* url :
       {"udpm://239.255.76.67:7667?ttl=1", "udpm://239.255.76.67:7667?recv_buf_size=1&ttl=32",
        "udpm://?ttl=0&ttl=1", "udpm://?ttl=1&ttl=0", "udpm://?ttl=0?ttl=1", "udpm://?ttl=0x1",
        "udpm://?ttl=01", "udpm://?ttl= 1", "udpm://?ttl=0 1", "udpm://?ttl", "udpm://?ttl=",
        "tcpq://localhost:7700", "mpudpm://239.255.76.67:7667", "nonsense", "UDPM://?ttl=0"}) {
    INFO(url);
    CHECK_FALSE(StaysOnMachine(url));
    CHECK_THROWS_WITH(RequireKey(url, false, false), Catch::Contains(url) &&
                                                         Catch::Contains("--key FILE") &&
                                                         Catch::Contains("--unsigned"));
    CHECK_NOTHROW(RequireKey(url, true, false));
    CHECK_NOTHROW(RequireKey(url, false, true));
  }
}

TEST_CASE("an empty URL is what liblcm makes of it") {
  const char* before = std::getenv("LCM_DEFAULT_URL");
  const std::string kept = before ? before : "";
  unsetenv("LCM_DEFAULT_URL");
  CHECK(StaysOnMachine(""));
  setenv("LCM_DEFAULT_URL", "udpm://239.255.76.67:7667?ttl=1", 1);
  CHECK_FALSE(StaysOnMachine(""));
  CHECK(StaysOnMachine("memq://"));
  if (before)
    setenv("LCM_DEFAULT_URL", kept.c_str(), 1);
  else
    unsetenv("LCM_DEFAULT_URL");
}

TEST_CASE("the interfaces through which others reach a multicast group") {
  const int own = getpid() % 60'000;
  const std::string url = "udpm://239.254." + std::to_string(own / 250) + "." +
                          std::to_string(own % 250 + 1) + ":17657?ttl=0";
  CHECK(OpenInterfaces(url).empty());  // nobody listens
  const Messenger messenger(url);
  // The same question to the kernel's routing table, where the group's route is plain: no line for
  // multicast, hence the default route's interface; or all of multicast to the loopback.
  const std::vector<std::string> interfaces = OpenInterfaces(url);
  std::ifstream table("/proc/net/route");
  std::string line, route_default, route_multicast;
  while (std::getline(table, line)) {
    std::istringstream words(line);
    std::string name, destination;
    words >> name >> destination;
    if (destination == "00000000") route_default = name;
    if (destination == "000000E0") route_multicast = name;
  }
  const std::string route = route_multicast.empty() ? route_default : route_multicast;
  INFO("route " << route);
  if (route.empty() || route == "lo")
    CHECK(interfaces.empty());
  else
    CHECK(std::find(interfaces.begin(), interfaces.end(), route) != interfaces.end());
  CHECK(OpenInterfaces("memq://").empty());
  CHECK(OpenInterfaces("udpm://rubbish:1").empty());
}

}  // namespace
}  // namespace plumb
