#include "common/lcm_receiver.h"

#include <poll.h>

#include <catch2/catch.hpp>
#include <fstream>

#include "tests/common/datagrams.h"

namespace plumb {
namespace {

// So that tests may run side by side.
const int kPort = 20'000 + getpid() % 12'000;
constexpr char kGroup[] = "239.255.76.60";

MulticastAddress Address(int ttl = 0) {
  return {kGroup, static_cast<uint16_t>(kPort), ttl, 2 << 20};
}

/// What a listener to all channels hears until a message says "end".
struct Heard {
  explicit Heard(const MulticastAddress& address = Address()) : receiver(address) {
    receiver.Listen(".*", [this](const std::string& channel, std::span<const uint8_t> message) {
      messages.push_back(channel + " " + std::string(message.begin(), message.end()));
    });
  }
  const std::vector<std::string>& UntilEnd() {
    for (int i = 0; i < 1000 && (messages.empty() || messages.back() != "A end"); ++i) {
      pollfd readable{receiver.fd(), POLLIN, 0};
      poll(&readable, 1, 100);  // [ms]
      receiver.Drain(1'000'000);
    }
    return messages;
  }
  LcmReceiver receiver;
  std::vector<std::string> messages;
};

TEST_CASE(
    "what was sent to the group comes in, and nothing else: not to this machine alone, not to "
    "another group") {
  const int ttl = GENERATE(0, 1);
  // Somebody on this machine has joined the other group: the kernel takes its datagrams.
  MulticastAddress other = Address(ttl);
  other.group = "239.255.76.59";
  const LcmReceiver neighbour(other);
  Heard heard(Address(ttl));
  const RawSender group(kGroup, kPort), loopback("127.0.0.1", kPort),
      elsewhere("239.255.76.59", kPort);
  group.Send(Whole("A", "first"));
  loopback.Send(Whole("A", "unicast"));
  elsewhere.Send(Whole("A", "another group"));
  group.Send(Whole("A", "end"));
  CHECK(heard.UntilEnd() == std::vector<std::string>{"A first", "A end"});
}

TEST_CASE("each listener hears its channel, in the order of arrival, until it is forgotten") {
  Heard all;
  std::vector<std::string> order;
  LcmReceiver::Queue* one = all.receiver.Listen(
      "ONE",
      [&](const std::string& channel, std::span<const uint8_t>) { order.push_back(channel); });
  all.receiver.Listen("TWO", [&](const std::string& channel, std::span<const uint8_t>) {
    order.push_back(channel);
  });
  const RawSender group(kGroup, kPort);
  for (const char* channel : {"TWO", "ONE", "ONE", "THREE", "TWO", "ONE"})
    group.Send(Whole(channel, "x"));
  group.Send(Whole("A", "end"));
  all.UntilEnd();
  CHECK(order == std::vector<std::string>{"TWO", "ONE", "ONE", "TWO", "ONE"});
  order.clear();
  all.receiver.Forget(one);
  for (const char* channel : {"TWO", "ONE"}) group.Send(Whole(channel, "x"));
  all.messages.clear();
  group.Send(Whole("A", "end"));
  all.UntilEnd();
  CHECK(order == std::vector<std::string>{"TWO"});
  pollfd readable{all.receiver.fd(), POLLIN, 0};
  LcmReceiver::Queue* const forgotten =
      all.receiver.Listen("ONE", [](const std::string&, std::span<const uint8_t>) {});
  group.Send(Whole("ONE", "x"));
  CHECK(poll(&readable, 1, 10'000) == 1);
  all.receiver.Drain(1);  // of the two that listen to it
  CHECK(poll(&readable, 1, 0) == 1);
  all.receiver.Forget(forgotten);
  CHECK(poll(&readable, 1, 0) == 0);
}

TEST_CASE("who is slow gets the newest 32 MB of a channel, and is told what it has missed") {
  LcmReceiver receiver(Address());
  constexpr int kSize = 50'000;
  constexpr int64_t kFit = LcmReceiver::kMaxQueued / kSize;
  int64_t handled = 0, rare = 0;
  int newest = 0;
  receiver.Listen("FLOOD", [&](const std::string&, std::span<const uint8_t> message) {
    ++handled;
    newest = std::atoi(std::string(message.begin(), message.begin() + 6).c_str());
  });
  receiver.Listen("RARE", [&](const std::string&, std::span<const uint8_t>) { ++rare; });
  const RawSender group(kGroup, kPort);
  group.Send(Whole("RARE", "x"));
  int sent = 100'000;
  const auto send = [&] {
    group.Send(Whole("FLOOD", std::to_string(++sent) + std::string(kSize - 6, 'x')));
  };
  int64_t lost = 0;
  while (lost < 2 * kFit) {
    REQUIRE(sent < 100'000 + 20 * kFit);
    send();
    for (const LcmReceiver::Loss& loss : receiver.TakeLosses()) {
      CHECK(loss.channel == "FLOOD");
      lost += loss.messages;
    }
  }
  receiver.Drain(1'000'000);
  CHECK(handled <= kFit);
  CHECK(handled > kFit * 9 / 10);
  CHECK(newest > 100'000 + 2 * kFit);
  CHECK(rare == 1);  // a flood on one channel does not push out another's
}

TEST_CASE("what arrives while it is drained waits for the next time") {
  Heard heard;
  const RawSender group(kGroup, kPort);
  int handled = 0;
  heard.receiver.Listen("AGAIN", [&](const std::string&, std::span<const uint8_t>) {
    ++handled;
    for (int i = 0; i < 3; ++i) group.Send(Whole("AGAIN", "x"));
  });
  group.Send(Whole("AGAIN", "x"));
  pollfd readable{heard.receiver.fd(), POLLIN, 0};
  REQUIRE(poll(&readable, 1, 10'000) == 1);
  const int first = heard.receiver.Drain(1'000'000);
  CHECK(first <= 2);
  CHECK(poll(&readable, 1, 10'000) == 1);
}

TEST_CASE("who leaves has all that was sent before, and nothing of what is sent afterwards") {
  Heard heard;
  const RawSender group(kGroup, kPort);
  constexpr size_t kMessages = 200;  // fit into any kernel's buffer, should nobody be quick enough
  for (size_t i = 0; i < kMessages; ++i) group.Send(Whole("A", std::to_string(i)));
  heard.receiver.Leave();
  group.Send(Whole("A", "end"));
  heard.receiver.Leave();  // once more is nothing else
  heard.receiver.Drain(1'000'000);
  REQUIRE(heard.messages.size() == kMessages);
  for (size_t i = 0; i < kMessages; ++i) REQUIRE(heard.messages[i] == "A " + std::to_string(i));
}

TEST_CASE("a group that cannot be joined is an error") {
  MulticastAddress address = Address();
  address.group = "192.0.2.1";
  CHECK_THROWS_AS(LcmReceiver(address), std::system_error);
}

}  // namespace
}  // namespace plumb
