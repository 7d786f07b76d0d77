#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>

#include "calibrator/motion/lcm_log.h"
#include "calibrator/motion/motion_log.h"
#include "tests/calibrator/motion/lcm_recording.h"
#include "tests/calibrator/synthetic.h"
#include "tests/temporary_file.h"

namespace plumb {
namespace {

Log ReadLog(const std::string& bytes, const RobotDescription& robot = Pendulum()) {
  return ReadLcmLog(TemporaryFile(bytes, ".lcmlog").path(), robot);
}

std::string LogRefusal(const std::string& bytes) {
  const TemporaryFile file(bytes, ".lcmlog");
  try {
    ReadLcmLog(file.path(), Pendulum());
  } catch (const std::runtime_error& error) {
    const std::string what = error.what();
    REQUIRE(what.find(file.path()) == 0);
    return what.substr(file.path().size());
  }
  return "nothing";
}

TEST_CASE("all episodes of a log are joined, named by a status or not") {
  Recording r;
  r.Episode(100, 30, 20);
  r.States(211, 239);
  r.Episode(200, 240, 20);
  SECTION("without a status the command after it tells where an episode ended") {}
  SECTION("with one") { r.Status(200, 440); }
  r.States(421, 460);
  const Log log = ReadLog(r.bytes);
  CHECK(log.warnings.empty());
  CHECK(log.drops.total() == 0);
  REQUIRE(log.rollouts.size() == 2);
  CHECK(log.rollouts[0].episode == 100);
  CHECK(log.rollouts[1].episode == 200);
  for (const Rollout& rollout : log.rollouts) {
    REQUIRE(rollout.transitions.size() == 20);
    CHECK(rollout.transitions[19].step == 19);
    CHECK(rollout.transitions[19].efforts.size() == 10);
    CHECK(rollout.transitions[19].duration() == Approx(0.05));
  }
  CHECK(log.rollouts[1].transitions[0].q(0) == Approx(0.24));
}

TEST_CASE("an episode whose end nobody tells ends a control period after its last command") {
  Recording r;
  r.Command(0, 5, 0);
  r.Command(10, 5, 1);
  r.States(0, 200);
  const Log log = ReadLog(r.bytes);
  REQUIRE(log.rollouts.size() == 1);
  REQUIRE(log.rollouts[0].transitions.size() == 2);
  CHECK(log.rollouts[0].transitions[1].next_q(0) == Approx(0.02));
  CHECK(log.drops.total() == 0);
}

TEST_CASE("a log cut off anywhere counts as far as it goes") {
  Recording r;
  r.Episode(100, 30, 20);
  r.States(211, 239);
  const size_t first_whole = r.bytes.size();
  r.Episode(200, 240, 20);
  size_t most = 0;
  for (size_t size = first_whole; size < r.bytes.size(); size += 997) {
    const Log log = ReadLog(r.bytes.substr(0, size));
    CHECK(log.rollouts[0].transitions.size() == 20);
    size_t transitions = 0;
    for (const Rollout& rollout : log.rollouts) transitions += rollout.transitions.size();
    CHECK(transitions >= most);
    most = transitions;
  }
  CHECK(most > 36);
  CHECK(most < 40);  // states come later than commands
}

TEST_CASE("that a log is cut off is said, and only then") {
  Recording r;
  r.Episode(100, 30, 20);
  r.States(211, 239);
  CHECK(ReadLog(r.bytes).warnings.empty());
  CHECK(ReadLog(r.bytes.substr(0, r.bytes.size() - 1)).warnings ==
        std::vector<std::string>{"its last message is cut off"});
}

TEST_CASE("a log of one transition") {
  Recording r;
  r.Command(0, 5, 0);
  r.States(0, 10);
  CHECK(ReadLog(r.bytes).rollouts[0].transitions.size() == 1);
}

TEST_CASE("however many episodes a log has, and however long they are, none is lost") {
  SECTION("many") {
    Recording r;
    constexpr int kEpisodes = 150;
    for (int i = 0; i < kEpisodes; ++i) r.Episode(1000 + i, 30 + 20 * i, 2);
    r.States(20 * kEpisodes + 30 - 20, 20 * kEpisodes + 60);
    const Log log = ReadLog(r.bytes);
    REQUIRE(log.rollouts.size() == kEpisodes);
    for (const Rollout& rollout : log.rollouts) CHECK(rollout.transitions.size() == 2);
  }
  SECTION("long, and idle for long after it") {
    Recording r;
    r.Episode(100, 30, 21'000);  // 210,000 states
    r.States(210'011, 230'000);
    const Log log = ReadLog(r.bytes);
    REQUIRE(log.rollouts.size() == 1);
    CHECK(log.rollouts[0].transitions.size() == 21'000);
    CHECK(log.drops.total() == 0);
  }
}

TEST_CASE("a driver that was restarted, and a second run in the same log, begin anew") {
  Recording r;
  r.Episode(100, 30, 20);
  r.States(211, 2000);
  SECTION("later") { r.start += 60'000'000; }
  SECTION("earlier: another recording") { r.start -= 1'000'000; }
  r.States(0, 9);
  r.Episode(300, 30, 20);
  r.States(211, 240);
  const Log log = ReadLog(r.bytes);
  REQUIRE(log.rollouts.size() == 2);
  CHECK(log.rollouts[0].transitions.size() == 20);
  CHECK(log.rollouts[1].transitions.size() == 20);
  CHECK(log.rollouts[1].episode == 300);
}

TEST_CASE("what does not decode, or is of another robot, is left out with a warning") {
  Recording r;
  r.Episode(100, 30, 20);
  r.AddBytes("JOINT_COMMAND", "rubbish");
  r.AddBytes("ROBOT_STATE_SMOOTHED", "");
  r.State(300, 2);
  r.AddBytes("CAMERA", "anything");
  r.States(211, 240);
  const Log log = ReadLog(r.bytes);
  CHECK(log.rollouts[0].transitions.size() == 20);
  REQUIRE(log.warnings.size() == 2);
  CHECK(log.warnings[0] == "2 messages do not decode");
  CHECK(log.warnings[1] == "1 messages are of a robot with 2 coordinates, 'pendulum' has 1");
}

TEST_CASE("hostile numbers in messages do no harm") {
  constexpr int64_t kHuge[] = {INT64_MAX, INT64_MIN, -1, int64_t{1} << 54, int64_t{1} << 52};
  for (const int64_t huge : kHuge) {
    Recording r;
    r.Episode(100, 30, 5);
    r.State(huge);
    r.Command(huge, 100, 3);
    r.Command(huge, huge, 0);
    r.Command(40, 100, INT32_MAX);
    r.Status(huge, huge);
    r.Status(100, huge);
    r.States(61, 240);
    INFO(huge);
    try {
      for (const Rollout& rollout : ReadLog(r.bytes).rollouts) {
        for (const Transition& t : rollout.transitions)
          CHECK(t.duration() == Approx(0.05).epsilon(0.21));
      }
    } catch (const std::runtime_error&) {
    }
  }
}

TEST_CASE("a log that is of no use is refused with the reason") {
  Recording other, states, commands, foreign, late, halved, damaged, assumed;
  other.AddBytes("CAMERA", "anything");
  states.States(0, 100);
  commands.Command(0, 5, 0);
  commands.Command(10, 5, 1);
  for (int i = 0; i < 10; ++i) foreign.State(i, 3);
  for (int i = 0; i < 5; ++i) late.Command(30 * i, 5, i);
  late.Command(150, -1, -1);
  late.States(0, 200);
  for (int i = 0; i <= 5; ++i) halved.Command(10 * i, i < 5 ? 5 : -1, i < 5 ? i : -1);
  for (int i = 0; i <= 200; i += 2) halved.State(i);
  damaged.Episode(100, 30, 20);
  assumed.model_based = true;
  assumed.Episode(100, 30, 20);
  assumed.States(211, 230);
  const size_t at = damaged.bytes.size();
  damaged.bytes += std::string(100, 'x');
  struct Case {
    const char* name;
    std::string bytes, refusal;
  };
  const std::string none = ": no transition can be used: ";
  const std::vector<Case> cases{
      {"empty", "", none + "it is empty"},
      {"cut off in the first head", damaged.bytes.substr(0, 20),
       none + "its first message is cut off"},
      {"cut off in the first message", damaged.bytes.substr(0, 50),
       none + "its first message is cut off"},
      {"cut off behind what says nothing", states.bytes.substr(0, states.bytes.size() - 1),
       none + "it holds no command of an episode; its last message is cut off"},
      {"other channels", other.bytes,
       none +
           "none of its 1 messages is a ROBOT_STATE_SMOOTHED, JOINT_COMMAND or CONTROLLER_STATUS"},
      {"no command", states.bytes, none + "it holds no command of an episode"},
      {"no state", commands.bytes,
       none + "states or commands are missing: 2 gaps, 0 late, 0 not finite, 0 across restarts"},
      {"every second state is lost", halved.bytes,
       none + "states or commands are missing: 5 gaps, 0 late, 0 not finite, 0 across restarts"},
      {"wrong robot", foreign.bytes,
       none + "10 messages are of a robot with 3 coordinates, 'pendulum' has 1"},
      {"another rate", late.bytes,
       none + "its commands answer states 0.15 s apart, but the task's control period is 0.05 s"},
      {"a state from the simulator's dynamics", assumed.bytes,
       ": its states are model-based: calibration would find the parameters that the estimator "
       "assumed. ROBOT_STATE_SMOOTHED "
       "has to be a kinematic estimator's"},
      {"a table", "t,q/pivot,v/pivot,u/pivot\n0,1,0,0\n0.05,1,0,0\n", ": is no LCM log"},
      {"garbage", std::string(5000, '\xa7'), ": is no LCM log"},
      {"damaged", damaged.bytes, ": damaged at byte " + std::to_string(at)},
  };
  for (const Case& c : cases) {
    INFO(c.name);
    CHECK(LogRefusal(c.bytes) == c.refusal);
  }
  CHECK_THROWS_WITH(ReadLcmLog("/nonexistent/run.lcmlog", Pendulum()),
                    "/nonexistent/run.lcmlog: cannot be opened");
  CHECK_THROWS_WITH(ReadLcmLog("/tmp", Pendulum()), "/tmp: is a folder");
}

TEST_CASE("whatever happens to a log, it is refused or read as finite transitions") {
  Recording r;
  r.Episode(100, 30, 6);
  r.Status(100, 90);
  r.States(71, 100);
  const RobotDescription robot = Pendulum();
  Random random(8);
  const TemporaryFile file("", ".lcmlog");
  for (int i = 0; i < 1500; ++i) {
    std::string mutant = r.bytes;
    for (uint32_t mistakes = 1 + random.Bits() % 8; mistakes > 0; --mistakes) {
      mutant[random.Bits() % mutant.size()] = static_cast<char>(random.Bits());
    }
    if (random.Bits() % 8 == 0) mutant.erase(random.Bits() % mutant.size(), random.Bits() % 300);
    file.Write(mutant);
    try {
      for (const Rollout& rollout : ReadLcmLog(file.path(), robot).rollouts) {
        for (const Transition& t : rollout.transitions) {
          REQUIRE(
              (t.q.allFinite() && t.v.allFinite() && t.next_q.allFinite() && t.next_v.allFinite()));
          REQUIRE(t.duration() == Approx(0.05).epsilon(0.21));
        }
      }
    } catch (const std::runtime_error& error) {
      REQUIRE(std::string(error.what()).find(file.path()) == 0);
    }
  }
}

TEST_CASE("a command that answers a state which no robot has been in costs no episode") {
  constexpr int64_t kPeriod = 240;  // states from an episode to the next
  const auto record = [](int64_t state, int64_t of) {
    Recording r;
    for (int64_t i = 0; i < 60; ++i) {
      const int64_t first = 30 + kPeriod * i;
      if (i == 20) r.Command(state, of < 0 ? 100 + i : of, 20);
      r.Episode(100 + i, first, 20);
      r.States(first + 181, first + kPeriod - 21);
    }
    return ReadLog(r.bytes);
  };
  const Log without = record(-1, 0);
  REQUIRE(CountTransitions(without.rollouts) == 1200);
  for (const int64_t state : {int64_t{1} << 62, int64_t{1} << 52, int64_t{1'000'000}}) {
    for (const int64_t of : {int64_t{-1}, int64_t{9'999}}) {  // that episode's, or its own
      INFO(state << " of " << of);
      const Log with = record(state, of);
      REQUIRE(with.rollouts.size() == without.rollouts.size());
      for (size_t i = 0; i < with.rollouts.size(); ++i) {
        CHECK(with.rollouts[i].episode == without.rollouts[i].episode);
        CHECK(with.rollouts[i].transitions.size() == 20);
      }
      REQUIRE(with.warnings.size() == 1);
      CHECK(with.warnings[0] == "1 commands answer states that the robot was never in");
    }
  }
}

// Each stays until it is over: 200 000 would be looked through for each of 200 000 commands.
TEST_CASE("episodes that never end are cut off, and counted") {
  Recording recording;
  recording.Episode(7, 0, 20);
  recording.States(181, 210);
  for (int i = 0; i < 200'000; ++i) recording.Command(4'000, 1'000 + i, 0);
  const Log log = ReadLog(recording.bytes);
  CHECK(CountTransitions(log.rollouts) == 20);
  REQUIRE(log.warnings.size() == 1);
  CHECK(log.warnings[0] == "195001 episodes never end: more than 5000 are under way at once");
}

}  // namespace
}  // namespace plumb
