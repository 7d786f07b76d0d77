#include "dashboard/access.h"

#include <catch2/catch.hpp>

#include "common/listen_address.h"

namespace plumb {
namespace {

TEST_CASE("a name that somebody else may lead to this machine is none of ours") {
  const Access access{{"robot.lab"}, {}, ""};
  for (const char* host : {"127.0.0.1:8765", "localhost:8765", "LOCALHOST", "[::1]:8765",
                           "192.168.1.7:80", "robot.lab:9000", "Robot.Lab"})
    CHECK(access.HostAllowed(host));
  for (const char* host : {"", "evil.example", "evil.example:8765", "127.0.0.1.evil.example",
                           "localhost.evil.example", "[::1", "[evil]:8765", "robot.lab.evil:8765",
                           "127.0.0.1@evil.example", "0x7f000001", "localhost:; script-src *"}) {
    INFO(host);
    CHECK_FALSE(access.HostAllowed(host));
  }
}

TEST_CASE("a page from elsewhere may not talk to us") {
  const Access access{{}, {"https://app.foxglove.dev"}, ""};
  CHECK(access.OriginAllowed("", "127.0.0.1:8765"));
  CHECK(access.OriginAllowed("http://127.0.0.1:8765", "127.0.0.1:8765"));
  CHECK(access.OriginAllowed("https://app.foxglove.dev", "127.0.0.1:8765"));
  for (const char* origin : {"null", "http://evil.example", "http://127.0.0.1:8766",
                             "http://127.0.0.1:8765.evil.example", "http://localhost:8765"})
    CHECK_FALSE(access.OriginAllowed(origin, "127.0.0.1:8765"));
}

TEST_CASE("where a token is needed, it comes as a cookie") {
  Access access;
  CHECK(access.TokenGiven(""));
  access.token = NewToken();
  CHECK(access.token.size() == 32);
  CHECK(access.token != NewToken());
  CHECK_FALSE(access.TokenGiven(""));
  CHECK(access.TokenGiven("a=b; plumb_token=" + access.token + "; c=d"));
  CHECK(access.TokenGiven("plumb_token8764=x; plumb_token8765=" + access.token));
  CHECK_FALSE(access.TokenGiven("plumb_token=" + access.token + "0"));
  CHECK_FALSE(access.TokenGiven("xplumb_token=" + access.token));
  CHECK_FALSE(access.TokenGiven("plumb_token=" + std::string(32, '0')));
  CHECK_FALSE(access.IsToken(""));
}

TEST_CASE("where to listen is a number and a port") {
  const auto parse = [](const char* text) {
    const ListenAddress listen = ListenAddress::Parse(text);
    return listen.address + " " + std::to_string(listen.port) + (listen.local() ? " local" : "");
  };
  CHECK(parse("127.0.0.1:1") == "127.0.0.1 1 local");
  CHECK(parse("") == "127.0.0.1 8765 local");
  CHECK(parse(":9000") == "127.0.0.1 9000 local");
  CHECK(parse("0.0.0.0") == "0.0.0.0 8765");
  CHECK(parse("localhost:0") == "127.0.0.1 0 local");
  CHECK(parse("[::1]:80") == "::1 80 local");
  CHECK(parse("[::]") == ":: 8765");
  for (const char* text : {"robots/pendulum", "localhost:65536", "1.2.3:80", "[::1", "::1:80", ":x",
                           "127.0.0.1:80 "}) {
    INFO(text);
    CHECK_THROWS_AS(ListenAddress::Parse(text), std::invalid_argument);
  }
}

}  // namespace
}  // namespace plumb
