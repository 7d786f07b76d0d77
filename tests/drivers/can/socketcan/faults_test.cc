// Faults of a bus, made by the kernel's own means: traffic control on a pair of vxcan
// interfaces, whose frames really pass a queue, and a serial adapter (slcan) of which we are the
// adapter.

#include <asm/termbits.h>
#include <fcntl.h>
#include <linux/tty.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <memory>
#include <string>

#include "common/file_descriptor.h"
#include "drivers/can/error_frame.h"
#include "tests/drivers/can/socketcan/vcan.h"

namespace plumb {
namespace {

using Catch::Matchers::Contains;

constexpr char kFreshPair[] =
    "ip link del vx0 2>/dev/null; ip link add dev vx0 type vxcan peer name vx1 && ip link set vx0 "
    "up && "
    "ip link set vx1 up";

Texts Numbered(int count) {
  Texts texts;
  for (int i = 0; i < count; ++i) {
    Frame frame{.id = 0x29};
    frame.length = 1;
    frame.data[0] = static_cast<uint8_t>(i);
    texts.push_back(ToText(frame));
  }
  return texts;
}

int64_t RealtimeNs() {
  timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  return int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

TEST_CASE("a full transmit queue refuses, and what it refused never comes") {
  // A frame in 16 s, but for the first two: nothing leaves the queue while we look.
  if (!Try(kFreshPair) || !Try("tc qdisc add dev vx0 root tbf rate 8bit burst 32 limit 1600"))
    return;
  const auto host = OpenTransport("socketcan:vx0"), drive = OpenTransport("socketcan:vx1");
  const int accepted = Send(*host, Numbered(64));
  CHECK(accepted >= 4);
  CHECK(accepted <= 16);  // and not the 100 that would find room in the queue
  CHECK(Send(*host, {"02E#00"}) == 0);
  CHECK(host->stats().refused == 64 - accepted + 1);
  CHECK(host->link() == LinkState::kUp);
  // Another's frame wakes the queue after the change.
  Shell("tc qdisc change dev vx0 root tbf rate 1mbit burst 32 limit 1600 && cansend vx0 7FF#");
  Texts through = Numbered(accepted);
  through.push_back("7FF#");
  CheckReceives(*drive, through);
  CHECK(Send(*host, {"02E#01"}) == 1);
  CheckReceives(*drive, {"02E#01"});
}

TEST_CASE("down and up empties the transmit queue") {
  if (!Try(kFreshPair) || !Try("tc qdisc add dev vx0 root tbf rate 8bit burst 32 limit 1600"))
    return;
  const auto host = OpenTransport("socketcan:vx0"), drive = OpenTransport("socketcan:vx1");
  const int accepted = Send(*host, Numbered(8));
  CHECK(accepted >= 4);
  Shell("ip link set vx0 down && tc qdisc del dev vx0 root && ip link set vx0 up");
  const size_t before = ReceiveAll(*drive).size();
  CHECK(before < 4);  // at 16 s each, but for the first two
  ReceiveAll(*host);
  CHECK(host->link() == LinkState::kUp);
  CHECK(Send(*host, {"02E#01"}) == 1);
  CheckReceives(*drive, {"02E#01"});
}

TEST_CASE("frames that the bus loses are not missed by who sent them") {
  if (!Try(kFreshPair) || !Try("tc qdisc add dev vx0 root netem loss 30%")) return;
  const auto host = OpenTransport("socketcan:vx0"), drive = OpenTransport("socketcan:vx1");
  for (int i = 0; i < 50; ++i) CHECK(Send(*host, Numbered(4)) == 4);
  const size_t received = ReceiveAll(*drive, 101).size();
  CHECK(received > 100);
  CHECK(received < 180);
  CHECK(host->stats().sent == 200);
  CHECK(drive->stats().lost == 0);  // not by us
}

TEST_CASE("delayed frames are stamped when they arrive") {
  if (!Try(kFreshPair) || !Try("tc qdisc add dev vx0 root netem delay 50ms")) return;
  const auto host = OpenTransport("socketcan:vx0"), drive = OpenTransport("socketcan:vx1");
  const int64_t before = RealtimeNs();
  CHECK(Send(*host, Numbered(3)) == 3);
  std::array<Frame, 8> frames;
  REQUIRE(Readable(*drive));
  const int64_t after = RealtimeNs();
  REQUIRE(drive->Receive(frames) >= 1);
  CHECK(frames[0].receive_ns - before > 40'000'000);
  CHECK(frames[0].receive_ns <= after);  // rather than when they are looked at
}

TEST_CASE("doubled and exchanged frames are handed out as they come") {
  if (!Try(kFreshPair) ||
      !Try("tc qdisc add dev vx0 root netem delay 5ms reorder 50% duplicate 20%"))
    return;
  const auto host = OpenTransport("socketcan:vx0"), drive = OpenTransport("socketcan:vx1");
  Texts sent;
  for (int i = 0; i < 20; ++i) {
    CHECK(Send(*host, Numbered(4)) == 4);
    for (const std::string& text : Numbered(4)) sent.push_back(text);
  }
  const Texts received = ReceiveAll(*drive, sent.size() + 1);
  CHECK(received.size() > sent.size());
  CHECK(received != sent);
  CHECK(drive->stats().malformed == 0);
}

TEST_CASE("error frames that are no bus-off change nothing") {
  FreshVcan();
  const auto bus = OpenTransport("socketcan:vcan0", {{.id = 0x29}}),
             other = OpenTransport("socketcan:vcan0");
  for (const char* text :
       {"20000004#001000000000FF60", "20000020#0000000000000000", "20000008#0000081900000000"}) {
    Shell("cansend vcan0 " + std::string(text));
    CheckReceives(*bus, {text});
    CHECK(Send(*bus, {"02E#00"}) == 1);
  }
  Shell("cansend vcan0 20000002#0500000000000000");  // lost arbitration is everyday traffic
  CHECK(ReceiveAll(*bus).empty());
}

TEST_CASE("bus-off: nothing goes out until the controller is back") {
  FreshVcan();
  const auto bus = OpenTransport("socketcan:vcan0"), other = OpenTransport("socketcan:vcan0");
  for (const char* back : {"20000100#0000000000000000", "029#00"}) {
    Shell("cansend vcan0 20000040#0000000000000000");
    CheckReceives(*bus, {"20000040#0000000000000000"});
    const int64_t refused = bus->stats().refused;
    CHECK(Send(*bus, {"02E#01", "02E#02"}) == 0);
    CHECK(bus->stats().refused == refused + 2);
    Shell("cansend vcan0 " + std::string(back));
    CheckReceives(*bus, {back});
    CHECK(Send(*bus, {"02E#03"}) == 1);
    CheckReceives(*other, {"20000040#0000000000000000", back, "02E#03"});
  }
}

/// A CAN adapter on a serial line: the kernel's end is an interface of kind "can", the other is
/// ours.
struct SerialAdapter {
  SerialAdapter() {
    our_end = FileDescriptor(posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK));
    REQUIRE(grantpt(our_end.get()) == 0);
    REQUIRE(unlockpt(our_end.get()) == 0);
    kernels_end = FileDescriptor(open(ptsname(our_end.get()), O_RDWR | O_NOCTTY));
    struct termios raw {};
    raw.c_cflag = CS8 | CREAD | CLOCAL | B38400;
    REQUIRE(ioctl(kernels_end.get(), TCSETS, &raw) == 0);
    const int discipline = N_SLCAN;
    if (ioctl(kernels_end.get(), TIOCSETD, &discipline) != 0) return;
    ifreq request{};
    REQUIRE(ioctl(kernels_end.get(), SIOCGIFNAME, &request) == 0);
    // It is made in the machine's first network namespace, which need not be ours.
    if (if_nametoindex(request.ifr_name) == 0) return;
    name = request.ifr_name;
    Shell("ip link set " + name + " up");
  }

  void Write(const std::string& text) {
    REQUIRE(write(our_end.get(), text.data(), text.size()) == static_cast<ssize_t>(text.size()));
  }
  /// The kernel's messages: so many lines, and what else comes within a moment.
  std::string Read(int lines) {
    std::string all;
    std::array<char, 256> part;
    pollfd polled{our_end.get(), POLLIN, 0};
    while (poll(&polled, 1, std::ranges::count(all, '\r') < lines ? kPatience : 50) == 1) {
      REQUIRE(all.size() < 10'000);
      const ssize_t size = read(our_end.get(), part.data(), part.size());
      if (size <= 0) break;
      all.append(part.data(), static_cast<size_t>(size));
    }
    return all;
  }

  FileDescriptor our_end, kernels_end;
  std::string name;  // empty: there is no slcan here
};

TEST_CASE("an adapter that goes bus-off") {
  RequireVcan();
  SerialAdapter adapter;
  if (adapter.name.empty()) {
    if (InGuest()) FAIL("the guest has no slcan");
    WARN("not tested: there is no slcan in this network namespace");
    return;
  }
  const auto bus = OpenTransport("socketcan:" + adapter.name);
  REQUIRE(!bus->warnings().empty());
  CHECK_THAT(bus->warnings()[0],
             Contains("restart-ms is 0") && Contains("ip link set " + adapter.name));
  CHECK(Send(*bus, {"02E#0000C03F"}) == 1);
  CHECK(adapter.Read(1) == "t02E40000C03F\r");
  adapter.Write("t0298000080BE00006040\r");
  CheckReceives(*bus, {"029#000080BE00006040"});

  // Nobody reads the line: some of these wait in the interface's queue when the adapter fails.
  CHECK(Send(*bus, Numbered(8)) >= 4);
  adapter.Write("sb256256\r");
  const Texts received = ReceiveAll(*bus, 1);
  REQUIRE(received.size() == 1);
  CHECK(DecodeErrorFrame(*FrameFromText(received[0])) == BusEvent::kBusOff);
  // A plain write would succeed, and the frame would be lost.
  CHECK(Send(*bus, {"02E#77"}) == 0);
  Shell("ip link set " + adapter.name + " down");
  adapter.Read(0);
  Shell("ip link set " + adapter.name + " up");
  CHECK(ReceiveAll(*bus).empty());
  CHECK(bus->link() == LinkState::kUp);
  CHECK(Send(*bus, {"02E#99"}) == 1);
  CHECK(adapter.Read(1) == "t02E199\r");  // the queue was emptied
}

TEST_CASE("an adapter that is unplugged") {
  RequireVcan();
  std::unique_ptr<Transport> bus;
  std::string name;
  {
    SerialAdapter adapter;
    if (adapter.name.empty()) return;
    name = adapter.name;
    bus = OpenTransport("socketcan:" + name);
  }
  CHECK(Readable(*bus));
  CHECK(ReceiveAll(*bus).empty());
  CHECK(bus->link() == LinkState::kGone);
  SerialAdapter adapter;
  CHECK(adapter.name == name);
  CHECK(ReceiveAll(*bus).empty());
  CHECK(bus->link() == LinkState::kUp);
  CHECK(Send(*bus, {"02E#01"}) == 1);
  CHECK(adapter.Read(1) == "t02E101\r");
}

}  // namespace
}  // namespace plumb
