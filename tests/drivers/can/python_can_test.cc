// A foreign implementation of the multicast bus: Debian's python3-can.

#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <string>

#include "drivers/can/transport.h"

extern char** environ;

namespace plumb {
namespace {

/// Long enough for any machine to start Python: only who fails waits so long.
constexpr int kPatience = 30'000;  // [ms]

/// The other side, which is ended with this object if it has not ended by itself.
class Peer {
 public:
  Peer(std::string group, std::string port) {
    const char* source = std::getenv("PLUMBLINE_SOURCE");
    std::string python = "/usr/bin/python3", script = std::string(source ? source : ".") +
                                                      "/tests/drivers/can/python_can_peer.py";
    const std::array<char*, 5> argv = {python.data(), script.data(), group.data(), port.data(),
                                       nullptr};
    REQUIRE(posix_spawn(&pid_, python.c_str(), nullptr, nullptr, argv.data(), environ) == 0);
    end_ = static_cast<int>(syscall(SYS_pidfd_open, pid_, 0));
    REQUIRE(end_ >= 0);
  }
  ~Peer() {
    if (pid_ > 0) kill(pid_, SIGKILL), waitpid(pid_, nullptr, 0);
    close(end_);
  }
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  /// The next frame that it sends.
  std::string NextText(Transport& transport) const {
    std::array<Frame, 1> frames;
    for (int wakes = 0; transport.Receive(frames) == 0; ++wakes) {
      std::array<pollfd, 2> polled = {{{transport.fd(), POLLIN, 0}, {end_, POLLIN, 0}}};
      if (wakes == 1000 || poll(polled.data(), polled.size(), kPatience) < 1) return "nothing";
      if (polled[0].revents == 0) return "nothing: the peer has ended";
    }
    return ToText(frames[0]);
  }
  /// Its exit status when it ends.
  int Wait() {
    pollfd polled{end_, POLLIN, 0};
    REQUIRE(poll(&polled, 1, kPatience) == 1);
    int status = -1;
    REQUIRE(waitpid(pid_, &status, 0) == pid_);
    pid_ = 0;
    return status;
  }

 private:
  pid_t pid_ = 0;
  int end_ = -1;  // readable when it has ended
};

TEST_CASE("python-can understands us and we understand it") {
  const std::string group = "239.74.163.79", port = std::to_string(20'000 + getpid() % 12'000);
  const auto bus = OpenTransport("udp:" + group + ":" + port);
  Peer peer(group, port);

  CHECK(peer.NextText(*bus) == "001#7265616479");
  const auto exchange = [&](const char* text) {
    const Frame frame = *FrameFromText(text);
    REQUIRE(bus->Send({&frame, 1}) == 1);
    return peer.NextText(*bus);
  };
  CHECK(exchange("02E#0000C03F00000000") == "02F#000000003FC00000");
  CHECK(exchange("1ABCDEF0#00010203") == "1ABCDEF1#03020100");
  CHECK(exchange("028#R") == "029#72656D6F7465");
  CHECK(exchange("124##1000102030405060708090A0B") == "125##10B0A09080706050403020100");
  CHECK(exchange("022#") == "023#");
  // The longest there are, with ids of 29 bits: what a moteus speaks.
  const std::string half = "000102030405060708090A0B0C0D0E0F101112131415161718191A1B1C1D1E1F";
  const std::string back = "1F1E1D1C1B1A191817161514131211100F0E0D0C0B0A09080706050403020100";
  CHECK(exchange(("00008002##1" + half + half).c_str()) == "00008003##1" + back + back);

  const Frame end = *FrameFromText("7FF#");
  bus->Send({&end, 1});
  CHECK(peer.Wait() == 0);
  CHECK(bus->stats().malformed == 0);
}

}  // namespace
}  // namespace plumb
