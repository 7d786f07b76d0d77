// Who is believed without a key: one speaker a channel.

#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>

#include "common/process_number.h"
#include "tests/common/sealed_message.h"

namespace plumb {
namespace {

using Catch::Contains;
using Reach = Identity::Reach;

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

TEST_CASE_METHOD(Unsigned, "a driver obeys no recording, neither of commands nor of requests") {
  const int64_t now = listener.Now(), long_ago = now - 2 * ChannelJudge::kOldest;
  CHECK(Believed(SayOfTheDead(7, long_ago)));
  listener.Lead("robot", "bus");
  ChannelJudge requests(Speakers::kSeveral);
  const std::string why = "said long ago by a process that is gone: a recording";
  for (ChannelJudge* const channel : {&judge, &requests}) {
    CHECK(Heard(*channel, listener, SayOfTheDead(7, long_ago)) == why);
    CHECK(Heard(*channel, listener, Say(one)).empty());  // nor does it keep others from speaking
    CHECK(Heard(*channel, listener, SayOfTheDead(7, long_ago + 1)) == why);
  }
  // In virtual time processes have no numbers.
  Bytes virtual_time = Encoded();
  virtual_time.resize(virtual_time.size() + kSealSize);
  WriteSeal({0, 7, 0, 1'000'000, {}}, nullptr, "", "", kChannel, virtual_time);
  CHECK(Heard(requests, listener, virtual_time) == why);
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
