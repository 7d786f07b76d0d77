// Who is believed with a key.

#include "common/identity.h"

#include <sodium.h>

#include <catch2/catch.hpp>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "tests/common/sealed_message.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

using Catch::Contains;
using Reach = Identity::Reach;

constexpr char kForeign[] = "not signed with the driver's key, for its robot and its bus";

std::string HexText(const Bytes& bytes) {
  std::string text(bytes.size() * 2 + 1, '\0');
  sodium_bin2hex(text.data(), text.size(), bytes.data(), bytes.size());
  text.pop_back();
  return text;
}

/// Processes that share a key and a clock that the test sets.
struct Signed {
  Signed() { time->now = kNow; }
  Identity Member(const std::string& name, const std::string& key_file = "key") {
    const std::string file = folder / key_file;
    if (!std::filesystem::exists(file)) MakeKeyFile(file);
    return Identity(name, SigningKey(file), Clock(time), Reach::kRun, 0);
  }
  Identity Driver(const std::string& name = "driver", const std::string& robot = "pendulum",
                  const std::string& bus = "socketcan:can0") {
    Identity driver = Member(name);
    driver.Lead(robot, bus);
    time->now += 1;
    return driver;
  }
  /// Somebody who has heard that driver.
  Identity Controller(const Identity& driver, const std::string& name = "controller") {
    Identity controller = Member(name);
    controller.Join(driver.run(), driver.robot(), driver.bus());
    return controller;
  }
  TemporaryFolder folder;
  std::shared_ptr<VirtualTime> time = std::make_shared<VirtualTime>();
};

TEST_CASE_METHOD(Signed, "a message with any bit changed, cut short or lengthened is not genuine") {
  Identity driver = Driver(), controller = Controller(driver);
  ChannelJudge judge;
  const Bytes message = Say(controller);
  for (size_t i = 0; i < message.size(); ++i) {
    for (int bit = 0; bit < 8; ++bit) {
      Bytes other = message;
      other[i] ^= static_cast<uint8_t>(1 << bit);
      REQUIRE(Heard(judge, driver, other) == kForeign);
    }
  }
  for (size_t size = 0; size < message.size(); ++size)
    REQUIRE(Heard(judge, driver, {message.begin(), message.begin() + static_cast<long>(size)}) ==
            kForeign);
  Bytes longer = message;
  longer.push_back(0);
  CHECK(Heard(judge, driver, longer) == kForeign);
  CHECK(Heard(judge, driver, Encoded()) == kForeign);
  // None of them has spoilt it for the real one, which is taken once.
  CHECK(Heard(judge, driver, message).empty());
  CHECK_THAT(Heard(judge, driver, message), Contains("repetition"));
}

TEST_CASE_METHOD(Signed, "what is signed belongs to one channel, one robot and one bus") {
  Identity driver = Driver(), controller = Controller(driver);
  const Bytes message = Say(controller);
  CHECK(ChannelJudge().Hear(driver, "DRIVER_REQUEST", message).refusal == kForeign);
  CHECK(ChannelJudge().Hear(driver, "JOINT_COMMAN", message).refusal == kForeign);
  // The same key, and even the same random number.
  for (const auto& [robot, bus] :
       {std::pair{"hopper", "socketcan:can0"}, std::pair{"pendulum", "socketcan:can1"},
        std::pair{"pendulumsocketcan", "can0"}}) {
    Identity other = Driver();
    other.Join(driver.run(), robot, bus);
    CHECK(ChannelJudge().Hear(other, kChannel, message).refusal == kForeign);
  }
  Identity stranger = Member("controller", "another key");
  stranger.Join(driver.run(), driver.robot(), driver.bus());
  CHECK(ChannelJudge().Hear(driver, kChannel, Say(stranger)).refusal == kForeign);
  CHECK(ChannelJudge().Hear(driver, kChannel, message).refusal.empty());
}

TEST_CASE_METHOD(Signed,
                 "what was signed for another run of the driver is void, whatever the clock") {
  Identity first = Driver(), controller = Controller(first);
  time->now += 60'000'000;
  const Bytes recorded = Say(controller);
  // The clock is set back to before the recording, and the driver is started again.
  time->now = kNow + 59'000'000;
  Identity second = Driver("driver, again");
  time->now = kNow + 60'000'000;
  ChannelJudge judge;
  CHECK(Heard(judge, second, recorded) == "signed for another run of the driver");
  Identity genuine = Controller(second);
  CHECK(Heard(judge, second, Say(genuine)).empty());
}

TEST_CASE_METHOD(Signed, "what was recorded, withheld or dated ahead is not taken") {
  Identity driver = Driver(), controller = Controller(driver);
  ChannelJudge judge;
  time->now = kNow - 1000;
  const Bytes recorded = Say(controller);
  time->now = kNow + 1000;
  const Bytes withheld = Say(controller);
  time->now = kNow + 4'000'000;
  const Bytes ahead = Say(controller);
  time->now = kNow + 1000;
  CHECK_THAT(Heard(judge, driver, recorded), Contains("before we started"));
  CHECK_THAT(Heard(judge, driver, ahead), Contains("in the future"));
  time->now = kNow + 10'001'001;
  CHECK_THAT(Heard(judge, driver, withheld), Contains("too long ago"));
  // It has not been shut out by them, nor by a moment's delay.
  Identity honest = Controller(driver, "honest");
  const Bytes late = Say(honest);
  time->now += 10'000'000;
  CHECK(Heard(judge, driver, late).empty());
}

TEST_CASE_METHOD(Signed, "only later messages are taken, though the clock goes back") {
  Identity driver = Driver(), controller = Controller(driver);
  ChannelJudge judge;
  const Bytes first = Say(controller), second = Say(controller);
  CHECK(Heard(judge, driver, second).empty());
  CHECK_THAT(Heard(judge, driver, first), Contains("repetition"));
  time->now -= 500'000;
  CHECK(Heard(judge, driver, Say(controller)).empty());
}

TEST_CASE_METHOD(Signed, "a driver hands out its run by a status that it has signed for itself") {
  Identity driver = Driver(), listener = Member("listener");
  ChannelJudge judge, commands;
  const auto adopted = [&](const Bytes& status, const char* robot, const char* bus) {
    return judge.HearDriver(listener, robot, bus, status).refusal.empty();
  };
  // Until then nothing is believed.
  Identity controller = Controller(driver);
  time->now += 10;
  CHECK_THAT(Heard(commands, listener, Say(controller)), Contains("has not been heard yet"));
  const Bytes status = Say(driver, "DRIVER_STATUS");
  CHECK_FALSE(adopted(status, "hopper", "socketcan:can0"));
  CHECK_FALSE(adopted(status, "pendulum", "socketcan:can1"));
  CHECK_FALSE(adopted(Say(controller, "DRIVER_STATUS"), "pendulum", "socketcan:can0"));
  CHECK_FALSE(adopted(Encoded(), "pendulum", "socketcan:can0"));
  REQUIRE(adopted(status, "pendulum", "socketcan:can0"));
  listener.Join(driver.run(), "pendulum", "socketcan:can0");
  CHECK(Heard(commands, listener, Say(controller)).empty());
  // A process follows the drivers of its robot, and one that leads follows nobody.
  CHECK(listener.Follows("hopper"));
  listener.Follow("pendulum");
  CHECK(listener.Follows("pendulum"));
  CHECK_FALSE(listener.Follows("hopper"));
  CHECK_FALSE(driver.Follows("pendulum"));
  // Two drivers who take turns are two.
  Identity other = Driver("driver 2");
  REQUIRE(adopted(Say(other, "DRIVER_STATUS"), "pendulum", "socketcan:can0"));
  listener.Join(other.run(), "pendulum", "socketcan:can0");
  time->now += 10;
  CHECK(judge.HearDriver(listener, "pendulum", "socketcan:can0", Say(driver, "DRIVER_STATUS"))
            .two_speakers);
}

// A foreign implementation makes the signature.
TEST_CASE_METHOD(Signed, "Python signs what we accept") {
  Identity driver = Driver(), controller = Controller(driver);
  const Bytes ours = Say(controller);
  Bytes unsigned_one = ours;
  std::fill(unsigned_one.end() - 32, unsigned_one.end(), uint8_t{0});
  const char* source = std::getenv("PLUMBLINE_SOURCE");
  const std::string call = "timeout 60 /usr/bin/python3 " + std::string(source ? source : ".") +
                           "/tests/common/sign.py " + folder / "key" + " pendulum socketcan:can0 " +
                           kChannel + " " + HexText(unsigned_one);
  FILE* pipe = popen(call.c_str(), "r");
  REQUIRE(pipe);
  std::string theirs(ours.size() * 2, '\0');
  REQUIRE(fread(theirs.data(), 1, theirs.size(), pipe) == theirs.size());
  CHECK(pclose(pipe) == 0);
  CHECK(theirs == HexText(ours));
}

}  // namespace
}  // namespace plumb
