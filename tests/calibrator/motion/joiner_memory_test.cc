// What the joiner keeps, and what becomes of it when a driver begins anew.

#include <malloc.h>

#include <catch2/catch.hpp>

#include "tests/calibrator/motion/recorded_episode.h"

namespace plumb {
namespace {

TEST_CASE_METHOD(RecordedEpisode,
                 "states of a driver that was restarted are not joined with earlier ones") {
  States();
  Commands();
  robot_state_t fresh = SmoothedState(120);  // counts again, later
  fresh.utime = SmoothedState(311).utime;
  joiner.OnState(fresh);
  CHECK(joiner.newest_state() == 120);
  CHECK(joiner.Join(42, 300).transitions.empty());
}

// Whoever can send messages can send any number of them.
TEST_CASE("what is remembered of messages has a bound in megabytes") {
  const RobotDescription robot = Pendulum();
  const auto used = [] { return mallinfo2().uordblks + mallinfo2().hblkhd; };
  const size_t before = used();
  TransitionJoiner joiner(robot);
  SECTION("of commands, in one episode or in many") {
    for (const int episodes : {1, 50}) {
      joint_command_t command = StepCommand(0);
      for (int i = 0; i < 1'000'000; ++i) {
        command.episode = i % episodes;
        command.step = i / episodes;
        joiner.OnCommand(command);
      }
      CHECK(used() - before < 20'000'000);
    }
  }
  SECTION("of states, however many contacts they have") {
    robot_state_t state = SmoothedState(0);
    state.num_contacts = 1'000'000;
    state.contact.resize(1'000'000);
    for (int i = 0; i < 200; ++i) {
      state.sequence = i;
      joiner.OnState(state);
    }
    CHECK(used() - before < 3'000'000);  // this test's own message is the most of it
  }
  SECTION("of states, however many there are") {
    for (int i = 0; i < 300'000; ++i) joiner.OnState(SmoothedState(i));
    CHECK(used() - before < 90'000'000);
  }
}

TEST_CASE_METHOD(RecordedEpisode,
                 "commands of other episodes beyond the bound do not cost the newest one") {
  States();
  for (int episode = 0; episode < 40; ++episode) {
    for (int step = 0; step < 6000; ++step) {
      joint_command_t command = StepCommand(step);
      command.episode = episode;
      joiner.OnCommand(command);
    }
  }
  Commands();
  CHECK(joiner.Join(42, 300).transitions.size() == 20);
}

TEST_CASE_METHOD(RecordedEpisode,
                 "the episodes that came first are forgotten, whatever their ids") {
  for (int64_t earlier = 0; earlier < 100; ++earlier) {  // of before the clock was set back
    joint_command_t command = StepCommand(0);
    command.episode = 1'000'000 + earlier;
    joiner.OnCommand(command);
  }
  States();
  Commands();
  CHECK(joiner.Join(42, 300).transitions.size() == 20);
}

TEST_CASE_METHOD(RecordedEpisode,
                 "a driver that is started anew while its clock is set back counts anew") {
  States(5000, 5010);
  CHECK_FALSE(joiner.BeginsRun(SmoothedState(4990)));  // it was late
  CHECK(joiner.BeginsRun(SmoothedState(90)));
  robot_state_t early = SmoothedState(5005);
  CHECK_FALSE(joiner.BeginsRun(early));  // it came twice
  early.utime = SmoothedState(90).utime;
  CHECK(joiner.BeginsRun(early));
  States();
  CHECK(joiner.newest_state() == 310);
  Commands();
  CHECK(joiner.Join(42, 300).transitions.size() == 20);
}

TEST_CASE_METHOD(RecordedEpisode, "a state that no driver can have counted to is not there") {
  for (const int64_t sequence : {INT64_MAX, TransitionJoiner::kMaxSequence + 1, int64_t{-1}}) {
    robot_state_t forged = SmoothedState(200);
    forged.sequence = sequence;
    joiner.OnState(forged);
  }
  CHECK(joiner.newest_state() == -1);
}

TEST_CASE_METHOD(RecordedEpisode, "each transition of an episode under way is taken once") {
  States();
  for (int i = 0; i < 10; ++i) joiner.OnCommand(StepCommand(i));
  CHECK(joiner.TakeArrived(42).size() == 9);
  CHECK(joiner.TakeArrived(42).empty());
  joint_command_t forged = StepCommand(0);
  forged.episode = INT64_MAX;
  joiner.OnCommand(forged);
  CHECK(joiner.TakeArrived(forged.episode).empty());
  for (int i = 10; i < 20; ++i) joiner.OnCommand(StepCommand(i));
  CHECK(joiner.TakeArrived(42).size() == 10);
  CHECK(joiner.Join(42, 300).transitions.size() == 20);
}

}  // namespace
}  // namespace plumb
