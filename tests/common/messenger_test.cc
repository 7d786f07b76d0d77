#include "common/messenger.h"

#include <arpa/inet.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <cstring>
#include <fstream>

#include "common/message_bytes.h"
#include "common/random.h"
#include "plumb/joint_state_t.hpp"
#include "plumb/parameter_distribution_t.hpp"
#include "tests/common/datagrams.h"

namespace plumb {
namespace {

joint_state_t Message(int64_t sequence) {
  joint_state_t m{};
  m.sequence = sequence;
  m.num_joints = 2;
  m.measured = {1, 2};
  m.position = m.velocity = m.effort_measured = m.effort_sent = m.effort_applied = {1, 2};
  m.valid = {1, 1};
  return m;
}

TEST_CASE("messages arrive in order, and none is lost to a bounded queue") {
  Messenger messenger("memq://");
  std::vector<int64_t> got;
  Subscriber<joint_state_t> subscriber(messenger, "JOINT_STATE",
                                       [&](const joint_state_t& m) { got.push_back(m.sequence); });
  Publisher<joint_state_t> publisher(messenger, "JOINT_STATE");
  for (int i = 0; i < 100; ++i) REQUIRE(publisher.Publish(Message(i)));
  messenger.Drain();
  REQUIRE(got.size() == 100);
  for (int i = 0; i < 100; ++i) CHECK(got[static_cast<size_t>(i)] == i);
  CHECK(subscriber.newest().sequence == 99);
}

TEST_CASE("a subscriber that is gone is not called") {
  Messenger messenger("memq://");
  int calls = 0;
  {
    Subscriber<joint_state_t> subscriber(messenger, "X", [&](const joint_state_t&) { ++calls; });
  }
  Subscriber<joint_state_t> other(messenger, "X");
  Publisher<joint_state_t> publisher(messenger, "X");
  publisher.Publish(Message(1));
  messenger.Drain();
  REQUIRE(other.received() == 1);
  CHECK(calls == 0);
}

// Every message with up to four bytes changed, and lengths an attacker would choose: all of them
// may arrive.
TEST_CASE("hostile messages are rejected, counted, and cost no memory") {
  Messenger messenger("memq://");
  Subscriber<parameter_distribution_t> subscriber(messenger, "X");
  parameter_distribution_t m{};
  m.num_parameters = 2, m.name = {"gravity", "mass"}, m.coordinate = {0, 1};
  m.num_components = 1, m.weight = {1}, m.num_means = 2, m.mean = {1, 2};
  m.num_covariances = 4, m.covariance = {1, 0, 0, 1};
  const std::vector<uint8_t> good = Encode(m);
  Random random(1);
  int sent = 0;
  const auto send = [&](const std::vector<uint8_t>& bytes) {
    messenger.Publish("X", bytes);
    ++sent;
    messenger.Drain();
  };
  for (int i = 0; i < 20000; ++i) {
    std::vector<uint8_t> bad = good;
    for (uint32_t k = 0; k <= i % 4u; ++k)
      bad[8 + random.Bits() % (bad.size() - 8)] = static_cast<uint8_t>(random.Bits());
    send(bad);
  }
  // the count of parameters: negative, 2^27, 2^29, largest
  for (const uint32_t count : {0xffffffffu, 1u << 27, 1u << 29, 0x7fffffffu, 0x80000000u}) {
    std::vector<uint8_t> bad = good;
    const uint32_t network = htonl(count);
    std::memcpy(bad.data() + 8 + 8 + 4 + 8, &network, 4);
    send(bad);
  }
  // cut off everywhere
  for (size_t length = 0; length < good.size(); ++length)
    send({good.begin(), good.begin() + static_cast<long>(length)});
  REQUIRE(subscriber.received() + subscriber.rejected() == sent);
  CHECK(subscriber.rejected() > static_cast<int64_t>(good.size()));
  CHECK(subscriber.newest().num_components <= 1);
#if !defined(__SANITIZE_THREAD__) && !defined(__SANITIZE_ADDRESS__)  // whose own memory counts
  long pages = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> pages >> resident;
  CHECK(resident * getpagesize() < 100'000'000);
#endif
  send(good);
  CHECK(subscriber.newest().name[0] == "gravity");
}

TEST_CASE("a message that does not decode leaves the newest good one alone") {
  Messenger messenger("memq://");
  Subscriber<joint_state_t> subscriber(messenger, "X");
  Publisher<joint_state_t> publisher(messenger, "X");
  publisher.Publish(Message(7));
  const std::vector<uint8_t> cut = Encode(Message(8));
  messenger.Publish("X", std::span(cut).first(cut.size() - 3));
  messenger.Drain();
  REQUIRE(subscriber.received() + subscriber.rejected() == 2);
  CHECK(subscriber.rejected() == 1);
  CHECK(subscriber.newest().sequence == 7);
}

// lcm-gen's decoders leave an array alone that has no elements in a message.
TEST_CASE("nothing of an earlier message is left in a later one") {
  Messenger messenger("memq://");
  Subscriber<parameter_distribution_t> subscriber(messenger, "X");
  Publisher<parameter_distribution_t> publisher(messenger, "X");
  parameter_distribution_t full{};
  full.num_means = 2, full.mean = {1, 2};
  full.num_draws = 1, full.draw = {3};
  full.num_starts = 3, full.start = {4, 5, 6};
  for (int i = 0; i < 2; ++i) publisher.Publish(full);  // a subscriber has two, and takes turns
  for (int i = 0; i < 2; ++i) {
    publisher.Publish(parameter_distribution_t{});
    messenger.Drain();
    CHECK(subscriber.newest().mean.empty());
    CHECK(subscriber.newest().draw.empty());
    CHECK(subscriber.newest().start.empty());
  }
}

TEST_CASE("a callback's exception does not cross LCM's C frames") {
  Messenger messenger("memq://");
  Subscriber<joint_state_t> subscriber(
      messenger, "X", [](const joint_state_t&) { throw std::runtime_error("mine"); });
  Publisher<joint_state_t> publisher(messenger, "X");
  for (int i = 0; i < 3; ++i) {
    publisher.Publish(Message(i));
    messenger.Drain();
  }
  CHECK(subscriber.received() == 3);
  CHECK_THROWS_WITH(subscriber.Rethrow(), "mine");
  CHECK_NOTHROW(subscriber.Rethrow());
}

// Without our own receiver a single one of these datagrams makes liblcm 1.3.1 write 4 GB out of
// bounds.
TEST_CASE("malformed LCM datagrams do no harm, by whatever URL") {
  const int port = 20'000 + getpid() % 12'000;  // so that tests may run side by side
  const std::string address = "udpm://239.255.76.61:" + std::to_string(port);
  std::string url = address + "?ttl=0&recv_buf_size=2097152";
  SECTION("that is given") {}
  SECTION("of the environment") {
    setenv("LCM_DEFAULT_URL", address.c_str(), 1);
    url = "";
  }
  Messenger messenger(url);
  unsetenv("LCM_DEFAULT_URL");
  Subscriber<joint_state_t> subscriber(messenger, "JOINT_STATE");
  const RawSender group("239.255.76.61", port);
  const std::string channel = "JOINT_STATE";
  group.Send(FragmentWith(channel, 1000, 0, 7, 0, 2, 500));
  group.Send(FragmentWith("", 1000, 0xffffff00, 7, 1, 2, 512));  // offset + length wraps
  group.Send(FragmentWith(channel, 0xffffffff, 0, 7, 0, 2, 500));
  group.Send(FragmentWith(channel, 100, 0, 7, 0, 1, 5000));  // longer than it says
  group.Send(FragmentWith(channel, 100, 0, 7, 0, 0, 10));
  Random random(3);
  for (int i = 0; i < 2000; ++i) {
    std::vector<uint8_t> p(random.Bits() % 200);
    for (uint8_t& byte : p) byte = static_cast<uint8_t>(random.Bits());
    if (p.size() > 4 && i % 2 == 0) std::memcpy(p.data(), i % 4 == 0 ? "LC02" : "LC03", 4);
    group.Send(p);
  }
  Publisher<joint_state_t> publisher(messenger, "JOINT_STATE");
  // Again and again: what comes faster than the machine reads, the kernel may drop.
  for (int i = 0; i < 1000 && subscriber.received() == 0; ++i) {
    REQUIRE(publisher.Publish(Message(1)));
    messenger.Await(100);  // [ms]
    messenger.Drain();
  }
  CHECK(subscriber.received() > 0);
  CHECK(subscriber.rejected() == 0);
}

TEST_CASE("an address that cannot be opened is an error with a cure") {
  CHECK_THROWS_WITH(Messenger("nonsense://"), Catch::Contains("nonsense"));
  CHECK_THROWS_WITH(Messenger("mpudpm://239.255.76.67:7667"),
                    Catch::Contains("mpudpm: is not supported") && Catch::Contains("cure: udpm:"));
  CHECK_THROWS_WITH(Messenger("udpm://nonsense"), Catch::Contains("'nonsense' is no IPv4"));
}

}  // namespace
}  // namespace plumb
