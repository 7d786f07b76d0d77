#include "calibrator/motion/transitions.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "tests/calibrator/motion/recorded_episode.h"

namespace plumb {
namespace {

TEST_CASE_METHOD(RecordedEpisode, "a state at a time that no clock shows is not there") {
  for (int64_t i = 90; i <= 310; ++i) {
    robot_state_t state = SmoothedState(i);
    if (i == 135) state.utime = INT64_MIN;
    if (i == 250) state.utime = INT64_MAX;  // the end of one step and the beginning of another
    joiner.OnState(state);
  }
  Commands();
  CHECK(joiner.Join(42, 300).transitions.size() == 17);
  CHECK(joiner.drops().gap == 3);
}

TEST_CASE_METHOD(RecordedEpisode, "a transition carries the effort applied, cycle by cycle") {
  States();
  Commands();
  const Rollout rollout = joiner.Join(42, 300);
  REQUIRE(rollout.transitions.size() == 20);
  const Transition& t = rollout.transitions[3];
  CHECK(t.step == 3);
  CHECK(t.q(0) == Approx(0.130));
  CHECK(t.next_q(0) == Approx(0.140));
  REQUIRE(t.efforts.size() == 10);
  for (int i = 0; i < 10; ++i) {
    CHECK(t.efforts[static_cast<size_t>(i)].duration == Approx(0.005));
    // the effort of state k was applied between k - 1 and k
    CHECK(t.efforts[static_cast<size_t>(i)].effort(0) == Approx(0.01 * (131 + i)));
  }
  CHECK(t.duration() == Approx(0.05));
}

// A staircase that steps from e0 to e1 at some time after state 130, as the driver averages it.
struct Staircase : RecordedEpisode {
  double Mean(int64_t sequence, double e0, double e1, double time) const {
    const double from = 0.005 * static_cast<double>(sequence - 1 - 130),
                 share = std::clamp((time - from) / 0.005, 0.0, 1.0);
    return share * e0 + (1 - share) * e1;
  }
  std::vector<EffortSegment> Joined(double e0, double e1, double time, double disturbance = 0) {
    for (int64_t i = 90; i <= 310; ++i) {
      robot_state_t state = SmoothedState(i);
      state.effort = {Mean(i, e0, e1, time) + (i == 137 ? disturbance : 0)};
      joiner.OnState(state);
    }
    Commands();
    return joiner.Join(42, 300).transitions[3].efforts;
  }
};

TEST_CASE_METHOD(Staircase, "an effort that steps between two measurements steps when it did") {
  for (const double time : {0.0012, 0.0068, 0.0249, 0.0444}) {
    joiner = TransitionJoiner(robot);
    const std::vector<EffortSegment> efforts = Joined(0.7, -1.9, time);
    REQUIRE(efforts.size() == 11);
    double t = 0;
    for (const EffortSegment& segment : efforts) {
      CHECK(segment.effort(0) == Approx(t < time - 1e-9 ? 0.7 : -1.9));
      t += segment.duration;
    }
    CHECK(t == Approx(0.05));
  }
}

TEST_CASE_METHOD(
    Staircase,
    "where it steps with a measurement, at the very end, or more than once, the means stand") {
  for (const double time : {0.010, 0.0481, -0.001, 0.060}) {
    joiner = TransitionJoiner(robot);
    const std::vector<EffortSegment> efforts = Joined(0.7, -1.9, time);
    REQUIRE(efforts.size() == 10);
    for (int i = 0; i < 10; ++i)
      CHECK(efforts[static_cast<size_t>(i)].effort(0) == Approx(Mean(131 + i, 0.7, -1.9, time)));
  }
  joiner = TransitionJoiner(robot);
  CHECK(Joined(0.7, -1.9, 0.0068, 0.01).size() == 10);
}

TEST_CASE_METHOD(RecordedEpisode, "the order in which the channels interleave does not matter") {
  Commands();
  for (int64_t i = 310; i >= 90; --i) joiner.OnState(SmoothedState(i));
  CHECK(joiner.Join(42, 300).transitions.size() == 20);
}

TEST_CASE_METHOD(RecordedEpisode, "gaps, lateness, restarts and rubbish are dropped and counted") {
  SECTION("a lost state") {
    States(90, 133);
    States(135, 310);
    Commands();
    CHECK(joiner.Join(42, 300).transitions.size() == 19);
    CHECK(joiner.drops().gap == 1);
  }
  SECTION("a lost command") {
    States();
    for (int i = 0; i < 20; ++i) {
      if (i != 5) joiner.OnCommand(StepCommand(i));
    }
    CHECK(joiner.Join(42, 300).transitions.size() == 18);
    CHECK(joiner.drops().gap == 1);
  }
  SECTION("a late command") {
    States();
    for (int i = 0; i < 20; ++i) {
      joint_command_t command = StepCommand(i);
      if (i == 7) command.state_sequence += 3;  // 65 ms, then 35 ms
      joiner.OnCommand(command);
    }
    CHECK(joiner.Join(42, 300).transitions.size() == 18);
    CHECK(joiner.drops().late == 2);
  }
  SECTION("a restart of the filter") {
    States();
    robot_state_t restarted = SmoothedState(155);
    restarted.restarted = 1;
    joiner.OnState(restarted);
    Commands();
    CHECK(joiner.Join(42, 300).transitions.size() == 19);
    CHECK(joiner.drops().restart == 1);
  }
  SECTION("a state with the simulator's dynamics in it, here between two transitions") {
    States();
    robot_state_t model_based = SmoothedState(160);
    model_based.model_based = 1;
    joiner.OnState(model_based);
    Commands();
    CHECK(joiner.Join(42, 300).transitions.size() == 18);
    CHECK(joiner.drops().model_based == 2);
    CHECK(joiner.drops().total() == 2);
    CHECK(joiner.drops().summary() ==
          "0 gaps, 0 late, 0 not finite, 0 across restarts, 2 model-based");
  }
  SECTION("an end of which nothing is known but the last state that was acted on") {
    States();
    Commands();
    CHECK(joiner.Join(42, 290).transitions.size() == 19);
    CHECK(joiner.drops().gap == 1);
    CHECK(joiner.drops().total() == 1);
  }
  SECTION("an unknown effort") {
    States();
    robot_state_t unknown = SmoothedState(155);
    unknown.effort = {NAN};
    joiner.OnState(unknown);
    Commands();
    CHECK(joiner.Join(42, 300).transitions.size() == 19);
    CHECK(joiner.drops().not_finite == 1);
  }
  SECTION("messages of another robot, and hostile ones") {
    States();
    robot_state_t other = SmoothedState(155);
    other.num_positions = other.num_velocities = 2;
    joiner.OnState(other);
    joint_command_t command = StepCommand(3);
    command.step = 2'000'000'000;
    joiner.OnCommand(command);
    Commands();
    CHECK(joiner.Join(42, 300).transitions.size() == 20);
  }
  SECTION("an episode nobody has heard of") { CHECK(joiner.Join(43, 300).transitions.empty()); }
}

TEST_CASE_METHOD(RecordedEpisode,
                 "one state that is not physical takes its own transition, and no other") {
  const std::pair<std::vector<double> robot_state_t::*, double> forgeries[] = {
      {&robot_state_t::effort, 1e150}, {&robot_state_t::effort, -21 * robot.joints[0].effort_limit},
      {&robot_state_t::q, 1e150},      {&robot_state_t::v, -1e10},
      {&robot_state_t::q_sd, 1e-160},  {&robot_state_t::v_sd, -1}};
  for (const auto& [member, value] : forgeries) {
    joiner = TransitionJoiner(robot);
    States();
    robot_state_t forged = SmoothedState(130);
    (forged.*member)[0] = value;
    joiner.OnState(forged);
    Commands();
    const Rollout rollout = joiner.Join(42, 300);
    CHECK(rollout.transitions.size() >= 18);
    CHECK(joiner.drops().not_finite == 20 - static_cast<int64_t>(rollout.transitions.size()));
    for (const Transition& t : rollout.transitions) {
      for (const EffortSegment& segment : t.efforts) CHECK(std::abs(segment.effort(0)) < 10);
    }
  }
}

}  // namespace
}  // namespace plumb
