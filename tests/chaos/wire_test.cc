// What the monkey does follows from its seed, and befalls whom it says.

#include <algorithm>
#include <catch2/catch.hpp>
#include <set>

#include "chaos/wire.h"
#include "common/lockstep/participant.h"

namespace plumb {
namespace {

constexpr int64_t kSpan = 12'000'000;  // [us]

std::string Text(const std::vector<Prank>& script) {
  std::string text;
  for (const Prank& prank : script) text += Describe(prank) + "\n";
  return text;
}

TEST_CASE("a script follows from its seed, in order of time, and has all kinds of mischief") {
  CHECK(Text(MakeScript(1, 50, kSpan, false)) == Text(MakeScript(1, 50, kSpan, false)));
  CHECK(Text(MakeScript(1, 50, kSpan, false)) != Text(MakeScript(2, 50, kSpan, false)));
  std::set<Mischief> kinds, of_imu, without_imu;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const std::vector<Prank> script = MakeScript(seed, 50, kSpan, seed % 2 == 0);
    REQUIRE(script.size() == 50);
    CHECK(std::ranges::is_sorted(script, {}, &Prank::time));
    for (const Prank& prank : script) {
      kinds.insert(prank.what);
      if (prank.topic == "IMU") (seed % 2 == 0 ? of_imu : without_imu).insert(prank.what);
      CHECK((prank.time >= 0 && prank.time < kSpan));
    }
  }
  CHECK(kinds.size() == kMischiefs);
  CHECK(without_imu.empty());
  for (const Mischief what : {Mischief::kDrop, Mischief::kMadden, Mischief::kForge})
    CHECK(of_imu.contains(what));
}

struct OnTheWay {
  std::vector<lockstep_post_t> Carry(const std::string& listener, const std::string& channel,
                                     int64_t now = 10) {
    lockstep_post_t post;
    post.topic = ChannelTopic(channel);
    post.arrival = now;
    post.data = {1, 2, 3};
    post.size = 3;
    return wire.Carry(post, listener, now);
  }
  void Begin(Mischief what, double amount) {
    wire.Begin({.what = what, .whom = "b", .topic = "X", .duration = 100, .amount = amount}, 0);
  }
  Wire wire{1, [](lockstep_post_t& post, Random&) {
              post.data[0] = 9;
              return true;
            }};
};

TEST_CASE("pranks befall what one process hears on one channel, for their duration") {
  OnTheWay way;
  SECTION("lost") {
    way.Begin(Mischief::kDrop, 1);
    CHECK(way.Carry("b", "X").empty());
  }
  SECTION("late") {
    way.Begin(Mischief::kDelay, 1000);
    REQUIRE(way.Carry("b", "X").size() == 1);
    CHECK(way.Carry("b", "X")[0].arrival > 10);
  }
  SECTION("twice, and the second one later") {
    way.Begin(Mischief::kDouble, 1);
    const auto heard = way.Carry("b", "X");
    REQUIRE(heard.size() == 2);
    CHECK(heard[0].arrival == 10);
    CHECK(heard[1].arrival >= 10);
    CHECK(heard[1].data == heard[0].data);
  }
  SECTION("damaged") {
    way.Begin(Mischief::kCorrupt, 1);
    CHECK(way.Carry("b", "X").at(0).data != std::vector<uint8_t>{1, 2, 3});
  }
  SECTION("mad") {
    way.Begin(Mischief::kMadden, 1);
    CHECK(way.Carry("b", "X").at(0).data == std::vector<uint8_t>{9, 2, 3});
  }
  for (const auto& [listener, channel, now] :
       {std::tuple{"c", "X", 10}, std::tuple{"b", "Y", 10}, std::tuple{"b", "X", 100}}) {
    const auto heard = way.Carry(listener, channel, now);
    REQUIRE(heard.size() == 1);
    CHECK(heard[0].arrival == now);
    CHECK(heard[0].data == std::vector<uint8_t>{1, 2, 3});
  }
}

}  // namespace
}  // namespace plumb
