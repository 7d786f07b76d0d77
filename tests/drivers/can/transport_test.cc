#include "drivers/can/transport.h"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include <array>
#include <catch2/catch.hpp>
#include <cstring>

namespace plumb {
namespace {

/// A port of this process's own, so that tests may run side by side.
// Below the range from which the kernel takes ports by itself (32768 to 60999).
int Port() { return 20'000 + getpid() % 12'000; }
std::string UdpUrl() { return "udp:239.74.163.77:" + std::to_string(Port()); }

/// Long enough for any machine: only who fails waits so long.
constexpr int kPatience = 10'000;  // [ms]
/// As often as nobody is woken for nothing.
constexpr int kMaxWakes = 10'000;

bool Readable(const Transport& transport, int milliseconds = kPatience) {
  pollfd polled{transport.fd(), POLLIN, 0};
  return poll(&polled, 1, milliseconds) == 1;
}

/// Frames received until there are enough.
std::vector<Frame> ReceiveAll(Transport& transport, size_t enough) {
  std::vector<Frame> all;
  std::array<Frame, 8> frames;
  for (int wakes = 0; all.size() < enough && Readable(transport); ++wakes) {
    REQUIRE(wakes < kMaxWakes);
    const int count = transport.Receive(frames);
    all.insert(all.end(), frames.begin(), frames.begin() + count);
  }
  return all;
}

TEST_CASE("every transport of a loop hears the others and not itself") {
  const auto a = OpenTransport("loop:three"), b = OpenTransport("loop:three"),
             c = OpenTransport("loop:three");
  const auto elsewhere = OpenTransport("loop:other");
  const Frame frame = *FrameFromText("02E#0000C03F00000000");
  CHECK(a->Send({&frame, 1}) == 1);
  std::array<Frame, 4> frames;
  CHECK_FALSE(Readable(*a, 0));
  CHECK(a->Receive(frames) == 0);
  CHECK(elsewhere->Receive(frames) == 0);
  for (Transport* transport : {b.get(), c.get()}) {
    CHECK(Readable(*transport, 0));
    REQUIRE(transport->Receive(frames) == 1);
    CHECK(SameOnWire(frames[0], frame));
    CHECK(frames[0].receive_ns > 0);
    CHECK(transport->Receive(frames) == 0);
  }
}

TEST_CASE("a loop keeps the order and counts what it loses") {
  const auto a = OpenTransport("loop:flood"), b = OpenTransport("loop:flood");
  constexpr int kSent = 20'000;
  for (int i = 0; i < kSent; ++i) {
    Frame frame;
    frame.length = 4;
    std::memcpy(frame.data.data(), &i, 4);
    REQUIRE(a->Send({&frame, 1}) == 1);
  }
  std::array<Frame, 64> frames;
  int received = 0, last = -1;
  for (int count; (count = b->Receive(frames)) > 0;) {
    for (int i = 0; i < count; ++i) {
      int number;
      std::memcpy(&number, frames[static_cast<size_t>(i)].data.data(), 4);
      REQUIRE(number > last);
      last = number;
    }
    received += count;
    REQUIRE(received <= kSent);
  }
  CHECK(received > 50);
  CHECK(b->stats().lost == kSent - received);
  CHECK(b->stats().received == received);
}

TEST_CASE("a loop that is told the time stamps with it") {
  const auto a = OpenTransport("loop:time"), b = OpenTransport("loop:time");
  a->SetTime(123'456);
  const Frame frame = *FrameFromText("029#11");
  a->Send({&frame, 1});
  std::array<Frame, 2> frames;
  REQUIRE(b->Receive(frames) == 1);
  CHECK(frames[0].receive_ns == 123'456'000);
  CHECK(b->NextEvent() == Transport::kNever);
}

TEST_CASE("frames that only we may send are marked when another sends them") {
  for (const std::string& url : {std::string("loop:foreign"), UdpUrl()}) {
    INFO(url);
    const std::vector<Filter> filters = {
        {.id = 0x20, .mask = 0x7E0}, {.id = 0x2E, .own = true}, {.id = 0x100}};
    const auto master = OpenTransport(url, filters), second = OpenTransport(url, filters);
    std::vector<Frame> commands;
    for (const char* text :
         {"02E#00", "029#11", "02E#R", "0000002E#22", "100#", "20000040#0000000000000000"}) {
      commands.push_back(*FrameFromText(text));
    }
    REQUIRE(second->Send(commands) == 6);
    const std::vector<Frame> received = ReceiveAll(*master, 4);
    REQUIRE(received.size() == 4);
    for (const Frame& frame : received) CHECK(frame.foreign == (ToText(frame) == "02E#00"));
    CHECK(master->stats().foreign == 1);
    // A frame that is passed on does not keep the mark.
    REQUIRE(master->Send(std::span(received).first(2)) == 2);
    const std::vector<Frame> returned = ReceiveAll(*second, 2);
    REQUIRE(returned.size() == 2);
    CHECK(returned[0].foreign);
    CHECK_FALSE(returned[1].foreign);
    CHECK(second->stats().foreign == 1);
  }
}

TEST_CASE("filters let in what they name") {
  const auto a = OpenTransport("loop:filters");
  const auto host = OpenTransport("loop:filters", {{.id = 0x20, .mask = 0x7E0}});
  const auto device =
      OpenTransport("loop:filters", {{.id = 0x20, .mask = 0x7E0, .remote = true}, {.id = 0x7E6}});
  for (const char* text : {"029#11", "029#R", "049#11", "00000029#11", "7E6#R", "7E6#01",
                           "20000040#0000000000000000"}) {
    const Frame frame = *FrameFromText(text);
    a->Send({&frame, 1});
  }
  const auto texts = [](Transport& transport) {
    std::vector<std::string> result;
    std::array<Frame, 16> frames;
    const int count = transport.Receive(frames);
    for (int i = 0; i < count; ++i) result.push_back(ToText(frames[static_cast<size_t>(i)]));
    return result;
  };
  CHECK(texts(*host) == std::vector<std::string>{"029#11", "20000040#0000000000000000"});
  CHECK(texts(*device) ==
        std::vector<std::string>{"029#11", "029#R", "7E6#01", "20000040#0000000000000000"});
}

TEST_CASE("a filter is about ids of 11 bits or of 29, and FD frames pass as others do") {
  for (const std::string& url : {std::string("loop:extended"), UdpUrl()}) {
    INFO(url);
    const auto a = OpenTransport(url), host = OpenTransport(url, {{.id = 0x100}}),
               far = OpenTransport(
                   url,
                   {{.id = 0x1200, .mask = Filter::kAllExtended, .own = true, .extended = true}}),
               device = OpenTransport(url, {{.id = 0x12, .mask = 0x1FFF00FF, .extended = true}});
    const std::string longest(128, '5');
    std::vector<Frame> frames;
    for (const std::string& text :
         {"100##1" + longest, "00000100##1" + longest, "00001200##1" + longest,
          "00008012##1" + longest, "012##1" + longest, "00018012##1" + longest}) {
      frames.push_back(*FrameFromText(text));
    }
    REQUIRE(a->Send(frames) == 6);
    const auto gets = [&](Transport& transport) {
      const std::vector<Frame> received = ReceiveAll(transport, 1);
      REQUIRE(received.size() == 1);
      CHECK(received[0].foreign == (&transport == far.get()));
      return ToText(received[0]);
    };
    CHECK(gets(*host) == "100##1" + longest);
    CHECK(gets(*far) == "00001200##1" + longest);
    CHECK(gets(*device) == "00008012##1" + longest);
    CHECK(a->carries_fd());
  }
}

TEST_CASE("udp multicast carries frames, stamps their arrival and drops the sender's echo") {
  const auto a = OpenTransport(UdpUrl()), b = OpenTransport(UdpUrl());
  const auto other_group = OpenTransport("udp:239.74.163.78:" + std::to_string(Port()));
  std::vector<Frame> frames;
  for (const char* text :
       {"02E#0000C03F00000000", "029#R", "1ABCDEF0#0011", "124##1000102030405060708090A0B"}) {
    frames.push_back(*FrameFromText(text));
  }
  timespec before;
  clock_gettime(CLOCK_REALTIME, &before);
  REQUIRE(a->Send(frames) == 4);
  const std::vector<Frame> received = ReceiveAll(*b, 4);
  REQUIRE(received.size() == 4);
  for (size_t i = 0; i < 4; ++i) {
    CHECK(ToText(received[i]) == ToText(frames[i]));
    CHECK(received[i].receive_ns >= int64_t{before.tv_sec} * 1'000'000'000 + before.tv_nsec);
  }
  std::array<Frame, 4> none;
  for (int wakes = 0; a->stats().echoes < 4 && Readable(*a); ++wakes) {
    REQUIRE(wakes < kMaxWakes);
    REQUIRE(a->Receive(none) == 0);
  }
  CHECK(a->stats().echoes == 4);
  CHECK(a->stats().sent == 4);
  CHECK(other_group->Receive(none) == 0);
}

TEST_CASE("garbage on the multicast group is counted and forgotten") {
  const auto transport = OpenTransport(UdpUrl());
  const int fd = socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(Port()));
  inet_pton(AF_INET, "239.74.163.77", &address.sin_addr);
  const int ttl = 0;
  setsockopt(fd, IPPROTO_IP, IP_MULTICAST_TTL, &ttl, sizeof ttl);
  std::string garbage(1400, '\x8b');
  for (const size_t size : {size_t{0}, size_t{1}, size_t{160}, garbage.size()}) {
    sendto(fd, garbage.data(), size, 0, reinterpret_cast<sockaddr*>(&address), sizeof address);
  }
  close(fd);
  const auto sender = OpenTransport(UdpUrl());
  const Frame frame = *FrameFromText("021#0000000008000000");
  REQUIRE(sender->Send({&frame, 1}) == 1);
  const auto received = ReceiveAll(*transport, 1);
  REQUIRE(received.size() == 1);
  CHECK(SameOnWire(received[0], frame));
  CHECK(transport->stats().malformed == 4);
}

TEST_CASE("a flood of what is not for us does not keep Receive from returning") {
  const auto a = OpenTransport(UdpUrl());
  const auto b = OpenTransport(UdpUrl(), {{.id = 0x7FF}});
  const Frame frame = *FrameFromText("029#11");
  constexpr int64_t kSent = 200;
  for (int i = 0; i < kSent; ++i) REQUIRE(a->Send({&frame, 1}) == 1);
  std::array<Frame, 64> frames;
  REQUIRE(Readable(*a));
  CHECK(a->Receive(frames) == 0);
  CHECK(a->stats().echoes > 0);
  CHECK(a->stats().echoes <= 128);
  CHECK(b->Receive(frames) == 0);
  CHECK(Readable(*b));  // the rest
  for (int wakes = 0; a->stats().echoes < kSent && Readable(*a); ++wakes) {
    REQUIRE(wakes < kMaxWakes);
    REQUIRE(a->Receive(frames) == 0);
  }
  CHECK(a->stats().echoes == kSent);
}

TEST_CASE("a bus that cannot be opened says why") {
  const auto error = [](const std::string& url) {
    try {
      OpenTransport(url);
    } catch (const std::exception& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  using Catch::Matchers::Contains;
  CHECK_THAT(error("can0"), Contains("'can0' is not socketcan:INTERFACE"));
  CHECK_THAT(error("tcp:1.2.3.4:5"), Contains("udp:GROUP:PORT"));
  CHECK_THAT(error("udp:127.0.0.1:43113"), Contains("not an IPv4 multicast group"));
  CHECK_THAT(error("udp:239.74.163.2:043113"), Contains("not an IPv4 multicast group"));
  CHECK_THAT(error("udp:239.74.163.2"), Contains("and a port"));
  CHECK_THAT(error("udp:239.74.163.2:0"), Contains("and a port"));
  CHECK_THAT(error("udp:239.74.163.2:70000"), Contains("and a port"));
  CHECK_THAT(error("udp:239.74.163.2:43113x"), Contains("and a port"));
  CHECK_THAT(error("socketcan:nosuchcan"), Contains("nosuchcan") && Contains("udp:"));
  CHECK_THAT(error("socketcan:averyveryverylongname"), Contains("not an interface name"));
  for (const char* url : {"can0", "udp:1", "socketcan:x"})
    CHECK(error(url).find('\n') == std::string::npos);
}

}  // namespace
}  // namespace plumb
