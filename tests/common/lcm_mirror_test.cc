// Messages of a run in virtual time, on LCM.
#include "common/lockstep/lcm_mirror.h"

#include <unistd.h>

#include <catch2/catch.hpp>
#include <string>
#include <vector>

namespace plumb {
namespace {

std::string Url() {
  return "udpm://239.255.76.67:" + std::to_string(20000 + getpid() % 12000) +
         "?ttl=0&recv_buf_size=2097152";
}

std::span<const uint8_t> View(const std::string& text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

TEST_CASE("others hear all of it, and are heard apart from it") {
  LcmMirror mirror(Url());
  std::vector<LcmMirror::Message> strangers;
  Messenger other(Url());
  std::vector<std::string> heard;
  const auto subscription =
      other.Subscribe(".*", [&](const std::string& channel, std::span<const uint8_t> message) {
        if (channel.ends_with("STATE"))
          heard.push_back(channel + " " + std::string(message.begin(), message.end()));
      });
  for (int i = 0; i < 2000; ++i) {
    mirror.Publish(i % 2 == 0 ? "JOINT_STATE" : "ROBOT_STATE", View(std::to_string(i)));
  }
  other.Publish("JOINT_COMMAND", View("mine"));
  mirror.Flush();
  for (int i = 0; i < 1000 && strangers.empty(); ++i)
    usleep(10'000), strangers = mirror.TakeStrangers();
  REQUIRE(strangers.size() == 1);
  CHECK(strangers[0].channel == "JOINT_COMMAND");
  CHECK(std::string(strangers[0].bytes.begin(), strangers[0].bytes.end()) == "mine");
  for (int i = 0; i < 100 && heard.size() < 2000; ++i) other.Await(100), other.Drain();
  REQUIRE(heard.size() == 2000);
  CHECK(heard[1999] == "ROBOT_STATE 1999");
}

TEST_CASE("of strangers 8 MB are remembered, the first, until they are taken") {
  LcmMirror mirror(Url());
  Messenger other(Url());
  // No more in one go than fits into the socket's buffer.
  constexpr size_t kSize = 50'000, kFit = LcmMirror::kMaxStrangers / kSize;
  const auto say = [&](const std::string& text) {
    other.Publish("JOINT_COMMAND", View(text));
    // What comes back afterwards has been behind it.
    mirror.Publish("JOINT_STATE", View("behind " + text.substr(0, 10)));
    mirror.Flush();
  };
  for (size_t i = 0; i < 3 * kFit; ++i) say(std::to_string(i) + std::string(kSize, ' '));
  std::vector<LcmMirror::Message> strangers = mirror.TakeStrangers();
  size_t bytes = 0;
  for (const LcmMirror::Message& stranger : strangers) bytes += stranger.bytes.size();
  CHECK(bytes <= LcmMirror::kMaxStrangers);
  CHECK(bytes > LcmMirror::kMaxStrangers - 2 * kSize);
  REQUIRE_FALSE(strangers.empty());
  CHECK(strangers[0].bytes[0] == '0');
  say("there is room again");
  strangers = mirror.TakeStrangers();
  REQUIRE(strangers.size() == 1);
  CHECK(strangers[0].bytes[0] == 't');
}

TEST_CASE("a message that does not come back is given up, and the run goes on") {
  LcmMirror mirror(Url(), 5);
  mirror.Publish("POLICY", View("first"));
  mirror.Flush();
  CHECK(mirror.lost() == 0);
  // Larger than what the guard of LCM's socket lets in.
  const std::string huge(size_t{5} << 20, 'x');
  mirror.Publish("POLICY", View(huge));
  mirror.Flush();
  CHECK(mirror.lost() == 1);
  for (int i = 0; i < 1000; ++i) mirror.Publish("JOINT_STATE", View(std::to_string(i)));
  mirror.Flush();
  CHECK(mirror.lost() == 1);
  CHECK(mirror.TakeStrangers().empty());
}

}  // namespace
}  // namespace plumb
