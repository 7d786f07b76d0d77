// Who says what, and who is believed: signed and unsigned.

#include "common/identity.h"

#include <sodium.h>
#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "common/process_number.h"
#include "plumb/joint_command_t.hpp"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

using Bytes = std::vector<uint8_t>;
using Catch::Contains;
using Reach = Identity::Reach;

constexpr int64_t kNow = 1'700'000'000'000'000;  // [us]
constexpr char kChannel[] = "JOINT_COMMAND";
constexpr char kForeign[] = "not signed with the driver's key, for its robot and its bus";

std::string Hex(const Bytes& bytes) {
  std::string text(bytes.size() * 2 + 1, '\0');
  sodium_bin2hex(text.data(), text.size(), bytes.data(), bytes.size());
  text.pop_back();
  return text;
}

Bytes Encoded(double effort = 0.5) {
  joint_command_t command{};
  command.utime = kNow;
  command.num_joints = 1;
  command.effort = {effort};
  command.position = command.velocity = command.kp = command.kd = {0};
  Bytes bytes(static_cast<size_t>(command.getEncodedSize()));
  command.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

Bytes Say(Identity& who, std::string_view channel = kChannel) {
  Bytes bytes = Encoded();
  bytes.resize(bytes.size() + kSealSize);
  who.Seal(channel, bytes);
  return bytes;
}

/// Processes that share a key and a clock that the test sets.
struct Signed {
  Signed() { time->store(kNow); }
  Identity Member(const std::string& name, const std::string& key_file = "key") {
    const std::string file = folder / key_file;
    if (!std::filesystem::exists(file)) MakeKeyFile(file);
    return Identity(name, SigningKey(file), Clock(time), Reach::kRun, 0);
  }
  Identity Driver(const std::string& name = "driver", const std::string& robot = "pendulum",
                  const std::string& bus = "socketcan:can0") {
    Identity driver = Member(name);
    driver.Lead(robot, bus);
    *time += 1;
    return driver;
  }
  /// Somebody who has heard that driver.
  Identity Controller(const Identity& driver, const std::string& name = "controller") {
    Identity controller = Member(name);
    controller.Join(driver.run(), driver.robot(), driver.bus());
    return controller;
  }
  TemporaryFolder folder;
  std::shared_ptr<std::atomic<int64_t>> time = std::make_shared<std::atomic<int64_t>>();
};

std::string Heard(ChannelJudge& judge, const Identity& me, const Bytes& bytes) {
  return std::string(judge.Hear(me, kChannel, bytes).refusal);
}

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
  *time += 60'000'000;
  const Bytes recorded = Say(controller);
  // The clock is set back to before the recording, and the driver is started again.
  *time = kNow + 59'000'000;
  Identity second = Driver("driver, again");
  *time = kNow + 60'000'000;
  ChannelJudge judge;
  CHECK(Heard(judge, second, recorded) == "signed for another run of the driver");
  Identity genuine = Controller(second);
  CHECK(Heard(judge, second, Say(genuine)).empty());
}

TEST_CASE_METHOD(Signed, "what was recorded, withheld or dated ahead is not taken") {
  Identity driver = Driver(), controller = Controller(driver);
  ChannelJudge judge;
  *time = kNow - 1000;
  const Bytes recorded = Say(controller);
  *time = kNow + 1000;
  const Bytes withheld = Say(controller);
  *time = kNow + 4'000'000;
  const Bytes ahead = Say(controller);
  *time = kNow + 1000;
  CHECK_THAT(Heard(judge, driver, recorded), Contains("before we started"));
  CHECK_THAT(Heard(judge, driver, ahead), Contains("in the future"));
  *time = kNow + 10'001'001;
  CHECK_THAT(Heard(judge, driver, withheld), Contains("too long ago"));
  // It has not been shut out by them, nor by a moment's delay.
  Identity honest = Controller(driver, "honest");
  const Bytes late = Say(honest);
  *time += 10'000'000;
  CHECK(Heard(judge, driver, late).empty());
}

TEST_CASE_METHOD(Signed, "only later messages are taken, though the clock goes back") {
  Identity driver = Driver(), controller = Controller(driver);
  ChannelJudge judge;
  const Bytes first = Say(controller), second = Say(controller);
  CHECK(Heard(judge, driver, second).empty());
  CHECK_THAT(Heard(judge, driver, first), Contains("repetition"));
  *time -= 500'000;
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
  *time += 10;
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
  *time += 10;
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
                           kChannel + " " + Hex(unsigned_one);
  FILE* pipe = popen(call.c_str(), "r");
  REQUIRE(pipe);
  std::string theirs(ours.size() * 2, '\0');
  REQUIRE(fread(theirs.data(), 1, theirs.size(), pipe) == theirs.size());
  CHECK(pclose(pipe) == 0);
  CHECK(theirs == Hex(ours));
}

/// Processes without a key on one machine.
struct Unsigned {
  ChannelJudge judge;
  Identity listener = Member(), one = Member(), two = Member();
  static Identity Member(int64_t run = 0, Reach reach = Reach::kMachine) {
    return Identity("test", {}, Clock(), reach, run);
  }
  bool Believed(const Bytes& bytes) { return Heard(judge, listener, bytes).empty(); }
  bool Two(const Bytes& bytes) { return judge.Hear(listener, kChannel, bytes).two_speakers; }
  /// A message of a process that has ended.
  static Bytes SayOfTheDead(int64_t sender, int64_t counter) {
    int ends[2];
    REQUIRE(pipe(ends) == 0);
    const pid_t child = fork();
    if (child == 0) {
      const int64_t number = ProcessNumber(getpid());
      _exit(write(ends[1], &number, sizeof number) == sizeof number ? 0 : 1);
    }
    int64_t number = 0;
    REQUIRE(read(ends[0], &number, sizeof number) == sizeof number);
    REQUIRE(waitpid(child, nullptr, 0) == child);
    close(ends[0]), close(ends[1]);
    REQUIRE(number != 0);
    REQUIRE_FALSE(Runs(number));
    Bytes bytes = Encoded();
    bytes.resize(bytes.size() + kSealSize);
    WriteSeal({0, sender, number, counter, {}}, nullptr, "", "", kChannel, bytes);
    return bytes;
  }
};

TEST_CASE_METHOD(Unsigned, "without a key, whoever speaks beside a process that runs is a second") {
  REQUIRE(Believed(Say(one)));
  REQUIRE(Believed(Say(one)));
  CHECK(Two(Say(two)));
  CHECK(Two(Encoded()));  // of a program that is not ours
  CHECK_THAT(judge.owner(), Contains("process " + std::to_string(getpid())));
  CHECK(judge.latest() == "somebody who does not say who");
  CHECK(Believed(Say(one)));
}

TEST_CASE_METHOD(Unsigned, "who copies another's seal is found out when either of them speaks") {
  REQUIRE(Believed(Say(one)));
  const Bytes copied = Say(one);
  REQUIRE(Believed(copied));
  CHECK(Two(copied));
  // It counts on for the one that it copies, and that one speaks again.
  Bytes forged = Say(one);
  const Bytes genuine = Say(one);
  const Seal seal = *FindSeal(genuine);
  WriteSeal({0, seal.sender, seal.process, seal.counter + 5, {}}, nullptr, "", "", kChannel,
            forged);
  REQUIRE(Believed(forged));
  CHECK(Two(genuine));
}

TEST_CASE_METHOD(Unsigned, "a process that was started again takes its channel over at once") {
  REQUIRE(Believed(SayOfTheDead(7, 1000)));
  CHECK(Believed(Say(one)));
  CHECK(Believed(Say(one)));
}

TEST_CASE_METHOD(Unsigned, "a log may be played twice, with all that was started again in it") {
  for (int times = 0; times < 2; ++times) {
    CHECK(Believed(SayOfTheDead(7, 1000)));
    CHECK(Believed(SayOfTheDead(7, 1001)));
    CHECK(Believed(SayOfTheDead(8, 2000)));
  }
}

TEST_CASE_METHOD(Unsigned,
                 "a program that is not ours may speak alone, and not in turns with another") {
  CHECK(Believed(Encoded()));
  CHECK(Believed(Encoded()));
  CHECK(Believed(Say(one)));  // it may have ended: nobody knows
  CHECK(Two(Encoded()));
}

TEST_CASE_METHOD(Unsigned, "of a run only its processes are believed, but anybody may ask") {
  listener = Member(4711);
  Identity member = Member(4711), other_run = Member(4712);
  CHECK(Two(Encoded()));
  CHECK(Two(Say(one)));
  CHECK(Two(Say(other_run)));
  CHECK(Believed(Say(member)));
  ChannelJudge requests(Speakers::kSeveral);
  for (const Bytes& bytes : {Encoded(), Say(one), Say(two), Say(one), Encoded()})
    CHECK(Heard(requests, listener, bytes).empty());
}

TEST_CASE_METHOD(Unsigned, "on a network a repetition is one, and says nothing of who speaks") {
  listener = Member(0, Reach::kNetwork);
  const Bytes first = Say(one), second = Say(one);
  REQUIRE(Believed(first));
  REQUIRE(Believed(second));
  CHECK(Heard(judge, listener, second) == "a repetition");
  CHECK_FALSE(Two(first));
  // Where nobody can see whether the first one still runs, it is two when it speaks again.
  CHECK(Believed(Say(two)));
  CHECK(Two(Say(one)));
}

TEST_CASE("who only looks on believes everything and says nothing of himself") {
  Identity nobody;
  ChannelJudge judge;
  CHECK_FALSE(nobody.known());
  Identity one = Unsigned::Member(), two = Unsigned::Member();
  for (const Bytes& bytes : {Say(one), Say(two), Encoded(), Say(one)})
    CHECK(Heard(judge, nobody, bytes).empty());
}

TEST_CASE("a process has a number of its own, as long as it runs") {
  const int64_t number = ProcessNumber(getpid());
  REQUIRE(number != 0);
  CHECK(ProcessId(number) == getpid());
  CHECK(Runs(number));
  CHECK_FALSE(Runs(number + (1 << 22)));  // of the same id, started later
  CHECK_FALSE(Runs(0));
  CHECK(ProcessNumber(-1) == 0);
  const pid_t child = fork();
  if (child == 0) pause();
  const int64_t its = ProcessNumber(child);
  CHECK(its != number);
  CHECK(Runs(its));
  kill(child, SIGKILL);
  siginfo_t info;
  REQUIRE(waitid(P_PID, static_cast<id_t>(child), &info, WEXITED | WNOWAIT) == 0);
  CHECK_FALSE(Runs(its));  // dead, and not buried
  REQUIRE(waitpid(child, nullptr, 0) == child);
  CHECK_FALSE(Runs(its));
}

TEST_CASE("a message without a seal is all message, and with one it is found behind it") {
  CHECK(Unsealed(Encoded()).size() == Encoded().size());
  CHECK_FALSE(FindSeal(Encoded()));
  CHECK(Unsealed({}).empty());
  Identity one = Unsigned::Member(12);
  const Bytes sealed = Say(one);
  const std::span<const uint8_t> message = Unsealed(sealed);
  CHECK(Bytes(message.begin(), message.end()) == Encoded());
  REQUIRE(FindSeal(sealed));
  CHECK(FindSeal(sealed)->run == 12);
  CHECK(FindSeal(sealed)->sender == one.sender());
  CHECK(FindSeal(sealed)->signature == Signature{});
}

}  // namespace
}  // namespace plumb
