// Against the kernel's own SocketCAN: run by tests/with-vcan as root of a network namespace, or of
// a guest, that has vcan0 and ends with the test. Anywhere else every case fails or the whole is
// skipped; nothing passes untested.

#include <net/if.h>
#include <poll.h>
#include <signal.h>
#include <unistd.h>

#include <array>
#include <catch2/catch.hpp>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "drivers/can/can_link.h"
#include "drivers/can/error_frame.h"
#include "drivers/can/transport.h"
#include "tests/drivers/can/socketcan/vcan.h"
#include "tests/drivers/driver/rig.h"

namespace plumb {
namespace {

using Catch::Matchers::Contains;

TEST_CASE("frames of every kind cross vcan, stamped; the sender's echo is only counted") {
  FreshVcan();
  const auto a = OpenTransport("socketcan:vcan0"), b = OpenTransport("socketcan:vcan0");
  CHECK(a->link() == LinkState::kUp);
  const Texts texts = {"02E#0000C03F00000000",
                       "029#R",
                       "029#R8",
                       "1ABCDEF0#0011",
                       "124##1000102030405060708090A0B",
                       "00008001##1" + std::string(128, '5'),
                       "022#"};
  CHECK(a->carries_fd());
  CHECK(Send(*a, texts) == 7);
  std::array<Frame, 1> first;
  REQUIRE(Readable(*b));
  REQUIRE(b->Receive(first) == 1);
  CHECK(first[0].receive_ns > 1'000'000'000'000'000'000);
  Texts received = {ToText(first[0])};
  for (const std::string& text : ReceiveAll(*b, texts.size() - 1)) received.push_back(text);
  CHECK(received == texts);
  CheckEchoes(*a, 7);
  CHECK(a->stats().sent == 7);
  CHECK(b->stats().received == 7);
  CHECK(b->stats().malformed == 0);
}

/// candump -L on vcan0, until this object ends.
struct Candump {
  Candump() : pipe(popen("echo $$; exec candump -L vcan0", "r")) {
    REQUIRE(pipe);
    Read(kPatience);
    REQUIRE(std::atoi(heard.c_str()) > 0);
  }
  ~Candump() {
    kill(std::atoi(heard.c_str()), SIGTERM);
    pclose(pipe);
  }
  void Read(int milliseconds) {
    pollfd polled{fileno(pipe), POLLIN, 0};
    if (poll(&polled, 1, milliseconds) != 1) return;
    std::array<char, 4096> bytes;
    const ssize_t size = read(polled.fd, bytes.data(), bytes.size());
    REQUIRE(size > 0);  // it has not ended
    heard.append(bytes.data(), static_cast<size_t>(size));
  }

  FILE* pipe;
  std::string heard;  // its process id, and what it wrote
};

TEST_CASE("can-utils hear us and we hear them") {
  FreshVcan();
  const auto bus = OpenTransport("socketcan:vcan0");
  Shell("cansend vcan0 029#000080BE00006040 && cansend vcan0 029#R");
  CheckReceives(*bus, {"029#000080BE00006040", "029#R"});
  Candump candump;
  // It listens once it has heard anything.
  for (int i = 0; candump.heard.find("7FF#") == std::string::npos; ++i) {
    REQUIRE(i < 500);
    CHECK(Send(*bus, {"7FF#"}) == 1);
    candump.Read(20);
  }
  CHECK(Send(*bus, {"02E#0000C03F00000000"}) == 1);
  for (int i = 0; candump.heard.find("02E#0000C03F00000000") == std::string::npos; ++i) {
    REQUIRE(i < 500);
    candump.Read(20);
  }
}

TEST_CASE(
    "the kernel filters: other nodes, remote frames and 29-bit ids stay out, errors come in") {
  FreshVcan();
  const auto sender = OpenTransport("socketcan:vcan0");
  const auto host = OpenTransport("socketcan:vcan0", {{.id = 0x20, .mask = 0x7E0}});
  const auto drive =
      OpenTransport("socketcan:vcan0", {{.id = 0x20, .mask = 0x7E0, .remote = true}});
  const Texts all = {"029#11", "029#R", "049#11", "00000029#11", "1ABCD029#11", "03F#22"};
  CHECK(Send(*sender, all) == 6);
  Shell("cansend vcan0 20000040#0000000000000000");
  CheckReceives(*host, {"029#11", "03F#22", "20000040#0000000000000000"});
  // Frames that the filter keeps out do not even wake us.
  CHECK(Send(*sender, {"029#R", "049#11", "00000029#11"}) == 3);
  CHECK_FALSE(Readable(*host, 50));
  CheckReceives(*drive, {"029#11", "029#R", "03F#22", "20000040#0000000000000000", "029#R"});
}

TEST_CASE("another's command is told from our own echo, though it comes from this machine") {
  FreshVcan();
  const std::vector<Filter> filters = {{.id = 0x20, .mask = 0x7E0}, {.id = 0x2E, .own = true}};
  const auto master = OpenTransport("socketcan:vcan0", filters),
             second = OpenTransport("socketcan:vcan0", filters);
  CHECK(Send(*master, {"02E#01", "02E#02"}) == 2);
  CheckEchoes(*master, 2);
  CHECK(master->stats().foreign == 0);
  CheckReceives(*second, {"02E#01", "02E#02"});
  CHECK(second->stats().foreign == 2);

  Shell(
      "cansend vcan0 029#11 && cansend vcan0 02E#22 && cansend vcan0 02E#R && cansend vcan0 "
      "0000002E#33");
  std::array<Frame, 8> frames;
  REQUIRE(Readable(*master));
  REQUIRE(master->Receive(frames) == 2);
  CHECK_FALSE(frames[0].foreign);
  CHECK(frames[1].foreign);
  CHECK(ToText(frames[1]) == "02E#22");
  CHECK(master->stats().foreign == 1);
}

TEST_CASE("a batch goes out whole and in order") {
  FreshVcan();
  const auto a = OpenTransport("socketcan:vcan0"), b = OpenTransport("socketcan:vcan0");
  Texts texts;
  for (int i = 0; i < 100; ++i) {
    Frame frame{.id = 0x100};
    frame.length = 1;
    frame.data[0] = static_cast<uint8_t>(i);
    texts.push_back(ToText(frame));
  }
  CHECK(Send(*a, texts) == 100);
  CheckReceives(*b, texts);
}

TEST_CASE("a bus-off error frame stops the driver") {
  FreshVcan();
  Rig rig;
  rig.Start();
  const auto bus = OpenTransport("socketcan:vcan0", rig.driver->filters(0));
  REQUIRE(rig.Arm(1));
  Shell("cansend vcan0 20000040#0000000000000000");
  REQUIRE(Readable(*bus));
  std::array<Frame, 4> frames;
  REQUIRE(bus->Receive(frames) == 1);
  CHECK(DecodeErrorFrame(frames[0]) == BusEvent::kBusOff);
  rig.driver->OnFrame(0, frames[0], rig.now, rig.utime());
  CHECK(rig.driver->state() == DriveState::kFault);
  CHECK_THAT(rig.Reason(), Contains("bus-off"));
}

TEST_CASE("the interface goes down and comes up") {
  FreshVcan();
  const auto bus = OpenTransport("socketcan:vcan0", {{.id = 0x29}}),
             other = OpenTransport("socketcan:vcan0");
  const int fd = bus->fd();
  Shell("ip link set vcan0 down");
  CHECK(ReceiveAll(*bus).empty());
  CHECK(bus->link() == LinkState::kDown);
  // A dead bus looks like a quiet one to poll; the state remembers.
  CHECK_FALSE(Readable(*bus, 50));
  CHECK(bus->link() == LinkState::kDown);
  CHECK(bus->Reopen() == LinkState::kDown);
  CHECK(Send(*bus, {"02E#00", "02E#01"}) == 0);
  CHECK(bus->stats().refused == 2);

  Shell("ip link set vcan0 up");
  CHECK(Readable(*bus));  // the kernel says so
  CHECK(ReceiveAll(*bus).empty());
  CHECK(bus->link() == LinkState::kUp);
  CHECK(bus->fd() == fd);
  CHECK(other->Reopen() == LinkState::kUp);  // or one asks
  std::array<Frame, 1> none;
  CHECK(other->Receive(none) == 0);
  CHECK(other->link() == LinkState::kDown);  // it was, and nobody shall miss it
  ReceiveAll(*other);
  CHECK(other->link() == LinkState::kUp);
  CHECK(Send(*bus, {"02E#02"}) == 1);
  CheckReceives(*other, {"02E#02"});  // what was refused is not sent later
  CHECK(Send(*other, {"029#03", "049#03"}) == 2);
  CheckReceives(*bus, {"029#03"});
}

TEST_CASE("an interface that is down at the start") {
  FreshVcan();
  Shell("ip link set vcan0 down");
  const auto bus = OpenTransport("socketcan:vcan0");
  CHECK(bus->link() == LinkState::kDown);
  Shell("ip link set vcan0 up");
  ReceiveAll(*bus);
  CHECK(bus->link() == LinkState::kUp);
  CHECK(Send(*bus, {"02E#00"}) == 1);
}

TEST_CASE("the interface is removed and comes back") {
  FreshVcan();
  const auto bus = OpenTransport("socketcan:vcan0", {{.id = 0x29}});
  const int fd = bus->fd();
  Shell("ip link del vcan0");
  CHECK(ReceiveAll(*bus).empty());
  CHECK(bus->link() != LinkState::kUp);
  CHECK(Send(*bus, {"02E#00"}) == 0);
  CHECK(bus->Reopen() == LinkState::kGone);
  CHECK(bus->Reopen() == LinkState::kGone);
  const unsigned before = if_nametoindex("vcan0");
  FreshVcan();
  CHECK(if_nametoindex("vcan0") != before);
  CHECK(Readable(*bus));
  CHECK(ReceiveAll(*bus).empty());
  CHECK(bus->link() == LinkState::kUp);
  CHECK(bus->fd() == fd);
  const auto other = OpenTransport("socketcan:vcan0");
  CHECK(Send(*bus, {"02E#01"}) == 1);
  CheckReceives(*other, {"02E#01"});
  CHECK(Send(*other, {"029#03", "049#03"}) == 2);  // the new socket has the old one's filters
  CheckReceives(*bus, {"029#03"});
}

TEST_CASE("an interface that is replaced between two looks") {
  FreshVcan();
  const auto bus = OpenTransport("socketcan:vcan0");
  FreshVcan();
  std::array<Frame, 1> none;
  CHECK(bus->Receive(none) == 0);
  CHECK(bus->link() != LinkState::kUp);
  CHECK(ReceiveAll(*bus).empty());
  CHECK(bus->link() == LinkState::kUp);
  Shell("cansend vcan0 029#04");
  CheckReceives(*bus, {"029#04"});
}

TEST_CASE("a receiver that is too slow learns how much it lost") {
  FreshVcan();
  const auto slow = OpenTransport("socketcan:vcan0");
  const auto sender = OpenTransport("socketcan:vcan0");
  const Frame frame = *FrameFromText("029#000080BE00006040");
  int64_t sent = 0;
  std::array<Frame, 64> frames;
  for (int i = 0; i < 20'000; ++i) {
    sent += sender->Send({&frame, 1});
    if (i % 16 == 0) sender->Receive(frames);  // its echoes
  }
  int64_t received = 0;
  while (const int count = slow->Receive(frames)) received += count;
  CHECK(received > 1000);  // far more than the 278 frames of a default buffer
  // The count of losses travels with the next frame.
  CHECK(sender->Send({&frame, 1}) == 1);
  received += static_cast<int64_t>(ReceiveAll(*slow, 1).size());
  CHECK(slow->stats().lost == sent + 1 - received);
}

TEST_CASE("interfaces that are none") {
  RequireVcan();
  CHECK_THROWS_WITH(
      OpenTransport("socketcan:can7"),
      Contains("socketcan:can7: no such interface") && Contains("ip link add can7 type vcan"));
  CHECK_THROWS_WITH(OpenTransport("socketcan:lo"), Contains("socketcan:lo: not a CAN interface"));
}

TEST_CASE("the kernel tells what an interface is, to anybody") {
  FreshVcan();
  const auto link = ReadCanLink(static_cast<int>(if_nametoindex("vcan0")));
  REQUIRE(link);
  CHECK(link->kind == "vcan");
  CHECK_FALSE(link->restart_ms);
  CHECK_FALSE(ReadCanLink(12345));
}

}  // namespace
}  // namespace plumb
