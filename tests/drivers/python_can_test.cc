// A foreign implementation of the multicast bus: Debian's python3-can.

#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cstdlib>

#include "drivers/can/transport.h"

extern char** environ;

namespace plumb {
namespace {

/// The next frame whose id the peer would use, within ten seconds.
std::string NextText(Transport& transport) {
  std::array<Frame, 1> frames;
  while (transport.Receive(frames) == 0) {
    pollfd polled{transport.fd(), POLLIN, 0};
    if (poll(&polled, 1, 10'000) != 1) return "nothing";
  }
  return ToText(frames[0]);
}

TEST_CASE("python-can understands us and we understand it") {
  const char* source = std::getenv("PLUMBLINE_SOURCE");
  const std::string script = std::string(source ? source : ".") + "/tests/drivers/python_can_peer.py";
  const std::string group = "239.74.163.79", port = std::to_string(20'000 + getpid() % 20'000);
  const auto bus = OpenTransport("udp:" + group + ":" + port);

  std::string python = "/usr/bin/python3";
  std::array<std::string, 4> arguments = {python, script, group, port};
  std::array<char*, 5> argv{};
  std::ranges::transform(arguments, argv.begin(), [](std::string& text) { return text.data(); });
  pid_t pid = 0;
  REQUIRE(posix_spawn(&pid, python.c_str(), nullptr, nullptr, argv.data(), environ) == 0);

  CHECK(NextText(*bus) == "001#7265616479");
  const auto exchange = [&](const char* text) {
    const Frame frame = *FrameFromText(text);
    REQUIRE(bus->Send({&frame, 1}) == 1);
    return NextText(*bus);
  };
  CHECK(exchange("02E#0000C03F00000000") == "02F#000000003FC00000");
  CHECK(exchange("1ABCDEF0#00010203") == "1ABCDEF1#03020100");
  CHECK(exchange("028#R") == "029#72656D6F7465");
  CHECK(exchange("124##1000102030405060708090A0B") == "125##10B0A09080706050403020100");
  CHECK(exchange("022#") == "023#");

  const Frame end = *FrameFromText("7FF#");
  bus->Send({&end, 1});
  int status = -1;
  waitpid(pid, &status, 0);
  CHECK(status == 0);
  CHECK(bus->stats().malformed == 0);
}

}  // namespace
}  // namespace plumb
