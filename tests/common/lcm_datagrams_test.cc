#include "common/lcm_datagrams.h"

#include <algorithm>
#include <catch2/catch.hpp>

#include "common/random.h"
#include "tests/common/datagrams.h"

namespace plumb {
namespace {

std::string DatagramText(const LcmDatagrams::Message& message) {
  return {message.data.begin(), message.data.end()};
}

LcmDatagrams All() {
  return LcmDatagrams([](std::string_view) { return true; });
}

TEST_CASE("a message in one datagram") {
  LcmDatagrams datagrams([](std::string_view channel) { return channel != "UNWANTED"; });
  const std::vector<uint8_t> datagram = Whole("POLICY", "weights");
  const auto message = datagrams.Take(1, datagram);
  REQUIRE(message);
  CHECK(message->channel == "POLICY");
  CHECK(DatagramText(*message) == "weights");
  const std::vector<uint8_t> good = Whole("POLICY", "");
  CHECK(datagrams.Take(1, good)->data.empty());
  CHECK(datagrams.Take(1, Whole(std::string(63, 'x'), "y")));
  CHECK_FALSE(datagrams.Take(1, Whole(std::string(64, 'x'), "y")));
  CHECK_FALSE(datagrams.Take(1, Whole("UNWANTED", "weights")));
  for (size_t size = 0; size < good.size(); ++size)
    CHECK_FALSE(datagrams.Take(1, std::span(good).first(size)));
}

TEST_CASE("messages in fragments, those of several senders side by side") {
  LcmDatagrams datagrams = All();
  const std::string long_one(1000, 'a'), other(700, 'b');
  for (uint32_t n = 0; n < 3; ++n) {
    const auto first = datagrams.Take(1, Fragment("A", long_one, 4, n, 3));
    const auto second = datagrams.Take(2, Fragment("B", other, 4, n, 3));
    CHECK(first.has_value() == (n == 2));
    REQUIRE(second.has_value() == (n == 2));
    if (second) CHECK(DatagramText(*second) == other);
  }
  CHECK(datagrams.pending() == 0);
  // One that lacks a fragment is lost, and the next one is not.
  datagrams.Take(1, Fragment("A", long_one, 5, 0, 3));
  CHECK_FALSE(datagrams.Take(1, Fragment("A", long_one, 5, 2, 3)));
  CHECK(datagrams.pending() == 0);
  datagrams.Take(1, Fragment("A", long_one, 6, 0, 2));
  const auto whole = datagrams.Take(1, Fragment("A", long_one, 6, 1, 2));
  REQUIRE(whole);
  CHECK(whole->channel == "A");
  CHECK(DatagramText(*whole) == long_one);
}

// liblcm 1.3.1 writes 4 GB out of bounds for a single one of these.
TEST_CASE("fragments that lie beside their message are dropped with it") {
  const auto refused = [](std::vector<uint8_t> second) {
    LcmDatagrams datagrams = All();
    datagrams.Take(1, FragmentWith("A", 1000, 0, 7, 0, 2, 500));
    CHECK_FALSE(datagrams.Take(1, second));
    CHECK(datagrams.pending() == 0);
    CHECK_FALSE(datagrams.Take(1, FragmentWith("", 1000, 500, 7, 1, 2, 500)));
  };
  refused(FragmentWith("", 1000, 0xffffff00, 7, 1, 2, 512));  // offset + length wraps
  refused(FragmentWith("", 1000, 500, 7, 1, 2, 501));         // beyond the end
  refused(FragmentWith("", 1000, 499, 7, 1, 2, 500));
  refused(FragmentWith("", 2000, 500, 7, 1, 2, 500));
  refused(FragmentWith("", 1000, 500, 8, 1, 2, 500));
  refused(FragmentWith("", 1000, 500, 7, 1, 3, 500));
  refused(FragmentWith("", 1000, 500, 7, 1, 2, 499));  // complete and too short
  LcmDatagrams datagrams = All();
  CHECK_FALSE(datagrams.Take(1, FragmentWith("A", 0xffffffff, 0, 7, 0, 2, 500)));
  CHECK_FALSE(datagrams.Take(1, FragmentWith("A", kMaxLcmMessage + 1, 0, 7, 0, 2, 500)));
  CHECK_FALSE(datagrams.Take(1, FragmentWith("A", 100, 0, 7, 0, 1, 5000)));  // longer than it says
  CHECK_FALSE(datagrams.Take(1, FragmentWith("A", 100, 0, 7, 0, 0, 10)));
  CHECK_FALSE(datagrams.Take(1, FragmentWith("A", 100, 5, 7, 0, 1, 100)));
  CHECK_FALSE(datagrams.Take(1, FragmentWith("", 1000, 500, 7, 1, 2, 500)));  // without a first
}

TEST_CASE("what never gets complete takes 16 MB, and the latest can still be completed") {
  LcmDatagrams datagrams = All();
  const std::string half(kMaxLcmMessage, 'x');
  size_t most = 0;
  for (uint64_t sender = 0; sender < 200; ++sender) {
    datagrams.Take(sender, Fragment("A", half, 1, 0, 2));
    most = std::max(most, datagrams.pending());
  }
  CHECK(most > size_t{8} << 20);
  CHECK(most <= size_t{16} << 20);
  CHECK(datagrams.Take(199, Fragment("A", half, 1, 1, 2)));
  // Small ones have a bound of their own: 64 senders.
  for (uint64_t sender = 0; sender < 100'000; ++sender)
    datagrams.Take(sender, FragmentWith("A", 1000, 0, 1, 0, 2, 1));
  CHECK(datagrams.pending() < 10'000);
}

TEST_CASE("whatever datagrams hold, a message is well-formed or is none") {
  LcmDatagrams datagrams = All();
  Random random(3);
  const std::string text(300, 't');
  int messages = 0;
  for (int i = 0; i < 300'000; ++i) {
    const uint32_t kind = random.Bits() % 4;
    std::vector<uint8_t> bytes = kind == 0 ? Whole("CHANNEL", text)
                                           : Fragment("CHANNEL", text, random.Bits() % 2,
                                                      random.Bits() % 3, 1 + random.Bits() % 3);
    if (kind == 3) bytes.resize(random.Bits() % bytes.size());
    for (uint32_t k = random.Bits() % 3; k > 0 && !bytes.empty(); --k)
      bytes[random.Bits() % std::min<size_t>(bytes.size(), 40)] =
          static_cast<uint8_t>(random.Bits());
    const auto message = datagrams.Take(random.Bits() % 3, bytes);
    if (!message) continue;
    ++messages;
    REQUIRE(message->channel.size() <= 63);
    REQUIRE(message->data.size() <= kMaxLcmMessage);
    REQUIRE(std::ranges::count(message->channel, '\0') == 0);
  }
  CHECK(messages > 1000);
}

}  // namespace
}  // namespace plumb
