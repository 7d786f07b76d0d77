#include "common/lcm_url.h"

#include <catch2/catch.hpp>
#include <cstdlib>

namespace plumb {
namespace {

TEST_CASE("which LCM URLs stay on this machine") {
  for (const char* url :
       {kDefaultLcmUrl, "memq://", "file:///tmp/x.log", "udpm://", "udpm://239.255.76.67:7667",
        "udpm://?ttl=0", "udpm://239.255.76.67:7667?recv_buf_size=1&ttl=0",
        "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=1"}) {
    INFO(url);
    CHECK(StaysOnMachine(url));
    CHECK_NOTHROW(RequireKey(url, false, false));
  }
  // liblcm reads numbers as strtol does, in any base, takes the last of several, and has other
  // providers: what is not plain does not stay here.
  for (const char* url :
       {"udpm://239.255.76.67:7667?ttl=1", "udpm://239.255.76.67:7667?recv_buf_size=1&ttl=32",
        "udpm://?ttl=0&ttl=1", "udpm://?ttl=1&ttl=0", "udpm://?ttl=0?ttl=1", "udpm://?ttl=0x1",
        "udpm://?ttl=01", "udpm://?ttl= 1", "udpm://?ttl=0 1", "udpm://?ttl",
        "udpm://?ttl=", "udpm://239.255.76.67:7667?ttl=0&ttl=0", "udpm://239.255.76.67:0x1df3",
        "udpm://10.0.0.1:7667", "tcpq://localhost:7700", "mpudpm://239.255.76.67:7667", "nonsense",
        "UDPM://?ttl=0"}) {
    INFO(url);
    CHECK_FALSE(StaysOnMachine(url));
    CHECK_THROWS_WITH(RequireKey(url, false, false), Catch::Contains(url) &&
                                                         Catch::Contains("--key FILE") &&
                                                         Catch::Contains("--unsigned"));
    CHECK_NOTHROW(RequireKey(url, true, false));
    CHECK_NOTHROW(RequireKey(url, false, true));
  }
}

TEST_CASE("an empty URL is $LCM_DEFAULT_URL, or else our default") {
  const char* before = std::getenv("LCM_DEFAULT_URL");
  const std::string kept = before ? before : "";
  unsetenv("LCM_DEFAULT_URL");
  CHECK(ResolvedLcmUrl("") == kDefaultLcmUrl);
  CHECK(StaysOnMachine(""));
  setenv("LCM_DEFAULT_URL", "", 1);
  CHECK(ResolvedLcmUrl("") == kDefaultLcmUrl);
  setenv("LCM_DEFAULT_URL", "udpm://239.255.76.67:7667?ttl=1", 1);
  CHECK(ResolvedLcmUrl("") == "udpm://239.255.76.67:7667?ttl=1");
  CHECK_FALSE(StaysOnMachine(""));
  CHECK(StaysOnMachine("memq://"));
  if (before)
    setenv("LCM_DEFAULT_URL", kept.c_str(), 1);
  else
    unsetenv("LCM_DEFAULT_URL");
}

TEST_CASE("a group is one, however its URL is spelt") {
  const std::string group = LcmGroup("udpm://239.255.76.67:7667?ttl=0");
  for (const char* same : {"udpm://", "udpm://?ttl=1", "udpm://239.255.76.67:07667"})
    CHECK(LcmGroup(same) == group);
  CHECK(LcmGroup("udpm://239.255.76.67:7668") != group);
  CHECK(LcmGroup("udpm://239.255.76.68") != group);
  CHECK(LcmGroup("memq://") == "memq://");
}

TEST_CASE("where a udpm: URL leads") {
  CHECK(ParseUdpm("udpm://") == MulticastAddress{"239.255.76.67", 7667, 0, 2 << 20});
  CHECK(ParseUdpm("udpm://239.1.2.3") == MulticastAddress{"239.1.2.3", 7667, 0, 2 << 20});
  CHECK(ParseUdpm("udpm://239.1.2.3:99?recv_buf_size=5&ttl=1") ==
        MulticastAddress{"239.1.2.3", 99, 1, 5});
  CHECK(ParseUdpm(kDefaultLcmUrl) == MulticastAddress{"239.255.76.67", 7667, 0, 2 << 20});
  const auto refused = [](const std::string& url, const std::string& why) {
    INFO(url);
    CHECK_THROWS_WITH(ParseUdpm(url), Catch::StartsWith(url + ": ") && Catch::Contains(why));
  };
  refused("memq://", "not a udpm: URL");
  refused("udpm://rubbish:1", "'rubbish' is no IPv4 multicast group");
  refused("udpm://127.0.0.1:7667", "'127.0.0.1' is no IPv4 multicast group");
  refused("udpm://239.1.2.3:", "'' is no port: 1 to 65535 are");
  refused("udpm://239.1.2.3:65536", "'65536' is no port");
  refused("udpm://?ttl=256", "'256' is no ttl: 0 to 255 are");
  refused("udpm://?recv_buf_size=-1", "'-1' is no recv_buf_size");
  refused("udpm://?ttl=0&ttl=0", "'ttl' is given twice");
  refused("udpm://?tll=0", "'tll' is no option of udpm: ttl and recv_buf_size are");
}

}  // namespace
}  // namespace plumb
