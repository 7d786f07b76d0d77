#include "calibrator/motion/transitions.h"

#include <malloc.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "calibrator/live/calibrator.h"
#include "tests/calibrator/synthetic.h"

namespace plumb {
namespace {

robot_state_t State(int64_t sequence) {
  robot_state_t s{};
  s.sequence = sequence;
  s.utime = 7'000'000 + 5000 * sequence;
  s.num_positions = s.num_velocities = 1;
  s.q = {0.001 * static_cast<double>(sequence)};
  s.v = {0.2};
  s.q_sd = {1e-4};
  s.v_sd = {1e-2};
  s.effort = {0.01 * static_cast<double>(sequence)};
  s.valid = 1;
  return s;
}

joint_command_t Command(int step) {
  joint_command_t c{};
  c.state_sequence = 100 + 10 * step;
  c.episode = 42;
  c.step = step;
  c.num_joints = 1;
  c.effort = {1};
  c.position = c.velocity = c.kp = c.kd = {NAN};
  return c;
}

// 20 steps of 10 states each, from sequence 100 to 300.
struct Fixture {
  RobotDescription robot = Pendulum();
  TransitionJoiner joiner{robot};
  void States(int64_t from = 90, int64_t to = 310) {
    for (int64_t i = from; i <= to; ++i) joiner.OnState(State(i));
  }
  void Commands() {
    for (int i = 0; i < 20; ++i) joiner.OnCommand(Command(i));
  }
};

TEST_CASE_METHOD(Fixture, "a state at a time that no clock shows is not there") {
  for (int64_t i = 90; i <= 310; ++i) {
    robot_state_t state = State(i);
    if (i == 135) state.utime = INT64_MIN;
    if (i == 250) state.utime = INT64_MAX;  // the end of one step and the beginning of another
    joiner.OnState(state);
  }
  Commands();
  CHECK(joiner.Join(42, 300).transitions.size() == 17);
  CHECK(joiner.drops().gap == 3);
}

TEST_CASE_METHOD(Fixture, "a transition carries the effort applied, cycle by cycle") {
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
struct Staircase : Fixture {
  double Mean(int64_t sequence, double e0, double e1, double time) const {
    const double from = 0.005 * static_cast<double>(sequence - 1 - 130),
                 share = std::clamp((time - from) / 0.005, 0.0, 1.0);
    return share * e0 + (1 - share) * e1;
  }
  std::vector<EffortSegment> Joined(double e0, double e1, double time, double disturbance = 0) {
    for (int64_t i = 90; i <= 310; ++i) {
      robot_state_t state = State(i);
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

TEST_CASE_METHOD(Fixture, "the order in which the channels interleave does not matter") {
  Commands();
  for (int64_t i = 310; i >= 90; --i) joiner.OnState(State(i));
  CHECK(joiner.Join(42, 300).transitions.size() == 20);
}

TEST_CASE_METHOD(Fixture,
                 "states of a driver that was restarted are not joined with earlier ones") {
  States();
  Commands();
  robot_state_t fresh = State(120);  // counts again, later
  fresh.utime = State(311).utime;
  joiner.OnState(fresh);
  CHECK(joiner.newest_state() == 120);
  CHECK(joiner.Join(42, 300).transitions.empty());
}

TEST_CASE_METHOD(Fixture, "gaps, lateness, restarts and rubbish are dropped and counted") {
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
      if (i != 5) joiner.OnCommand(Command(i));
    }
    CHECK(joiner.Join(42, 300).transitions.size() == 18);
    CHECK(joiner.drops().gap == 1);
  }
  SECTION("a late command") {
    States();
    for (int i = 0; i < 20; ++i) {
      joint_command_t command = Command(i);
      if (i == 7) command.state_sequence += 3;  // 65 ms, then 35 ms
      joiner.OnCommand(command);
    }
    CHECK(joiner.Join(42, 300).transitions.size() == 18);
    CHECK(joiner.drops().late == 2);
  }
  SECTION("a restart of the filter") {
    States();
    robot_state_t restarted = State(155);
    restarted.restarted = 1;
    joiner.OnState(restarted);
    Commands();
    CHECK(joiner.Join(42, 300).transitions.size() == 19);
    CHECK(joiner.drops().restart == 1);
  }
  SECTION("a state with the simulator's dynamics in it, here between two transitions") {
    States();
    robot_state_t model_based = State(160);
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
    robot_state_t unknown = State(155);
    unknown.effort = {NAN};
    joiner.OnState(unknown);
    Commands();
    CHECK(joiner.Join(42, 300).transitions.size() == 19);
    CHECK(joiner.drops().not_finite == 1);
  }
  SECTION("messages of another robot, and hostile ones") {
    States();
    robot_state_t other = State(155);
    other.num_positions = other.num_velocities = 2;
    joiner.OnState(other);
    joint_command_t command = Command(3);
    command.step = 2'000'000'000;
    joiner.OnCommand(command);
    Commands();
    CHECK(joiner.Join(42, 300).transitions.size() == 20);
  }
  SECTION("an episode nobody has heard of") { CHECK(joiner.Join(43, 300).transitions.empty()); }
}

TEST_CASE("an iteration begins when its roll-outs are complete, whatever came first") {
  const RobotDescription robot = Pendulum();
  SimOpt simopt(robot, 1, 1);
  Calibrator calibrator(robot, simopt);
  controller_status_t status{};
  status.phase = controller_status_t::COMPLETE;
  status.purpose = 0;
  status.num_episodes = 1;
  status.episode = {42};
  status.first_state_sequence = {100};
  status.last_state_sequence = {300};
  status.returns = {0};
  SECTION("the status first") {
    calibrator.OnControllerStatus(status);
    for (int i = 0; i < 20; ++i) calibrator.OnCommand(Command(i));
    for (int64_t i = 90; i < 300; ++i) calibrator.OnState(State(i));
    CHECK_FALSE(calibrator.ready());
    calibrator.OnState(State(300));
  }
  SECTION("the states first") {
    for (int64_t i = 90; i <= 310; ++i) calibrator.OnState(State(i));
    for (int i = 0; i < 20; ++i) calibrator.OnCommand(Command(i));
    CHECK_FALSE(calibrator.ready());
    calibrator.OnControllerStatus(status);
  }
  SECTION("the driver has been started again, and counts from 0: what is lacking never comes") {
    for (int i = 0; i < 20; ++i) calibrator.OnCommand(Command(i));
    for (int64_t i = 90; i < 300; ++i) calibrator.OnState(State(i));
    robot_state_t again = State(300);
    again.sequence = 0;
    calibrator.OnState(again);
    calibrator.OnControllerStatus(status);
    CHECK(calibrator.ready());
    status.episode = {43};  // one that has been seen to begin since does wait
    calibrator.OnControllerStatus(status);
    CHECK_FALSE(calibrator.ready());
    return;
  }
  REQUIRE(calibrator.ready());
  CHECK(calibrator.Begin() == 20);
  CHECK(CountTransitions(simopt.state().rollouts) == 20);
  for (int update = 0; !simopt.Update(); ++update) REQUIRE(update < 100);
  calibrator.OnControllerStatus(status);  // repeated at 10 Hz
  CHECK_FALSE(calibrator.ready());
  status.policy_iteration = 1;
  status.purpose = 1;  // evaluation roll-outs are for judging
  calibrator.OnControllerStatus(status);
  CHECK_FALSE(calibrator.ready());
}

// Whoever can send messages can send any number of them.
TEST_CASE("what is remembered of messages has a bound in megabytes") {
  const RobotDescription robot = Pendulum();
  const auto used = [] { return mallinfo2().uordblks + mallinfo2().hblkhd; };
  const size_t before = used();
  TransitionJoiner joiner(robot);
  SECTION("of commands, in one episode or in many") {
    for (const int episodes : {1, 50}) {
      joint_command_t command = Command(0);
      for (int i = 0; i < 1'000'000; ++i) {
        command.episode = i % episodes;
        command.step = i / episodes;
        joiner.OnCommand(command);
      }
      CHECK(used() - before < 20'000'000);
    }
  }
  SECTION("of states, however many contacts they have") {
    robot_state_t state = State(0);
    state.num_contacts = 1'000'000;
    state.contact.resize(1'000'000);
    for (int i = 0; i < 200; ++i) {
      state.sequence = i;
      joiner.OnState(state);
    }
    CHECK(used() - before < 3'000'000);  // this test's own message is the most of it
  }
  SECTION("of states, however many there are") {
    for (int i = 0; i < 300'000; ++i) joiner.OnState(State(i));
    CHECK(used() - before < 90'000'000);
  }
}

TEST_CASE_METHOD(Fixture,
                 "commands of other episodes beyond the bound do not cost the newest one") {
  States();
  for (int episode = 0; episode < 40; ++episode) {
    for (int step = 0; step < 6000; ++step) {
      joint_command_t command = Command(step);
      command.episode = episode;
      joiner.OnCommand(command);
    }
  }
  Commands();
  CHECK(joiner.Join(42, 300).transitions.size() == 20);
}

TEST_CASE_METHOD(Fixture, "the episodes that came first are forgotten, whatever their ids") {
  for (int64_t earlier = 0; earlier < 100; ++earlier) {  // of before the clock was set back
    joint_command_t command = Command(0);
    command.episode = 1'000'000 + earlier;
    joiner.OnCommand(command);
  }
  States();
  Commands();
  CHECK(joiner.Join(42, 300).transitions.size() == 20);
}

TEST_CASE_METHOD(Fixture, "a driver that is started anew while its clock is set back counts anew") {
  States(5000, 5010);
  CHECK_FALSE(joiner.BeginsRun(State(4990)));  // it was late
  CHECK(joiner.BeginsRun(State(90)));
  States();
  CHECK(joiner.newest_state() == 310);
  Commands();
  CHECK(joiner.Join(42, 300).transitions.size() == 20);
}

TEST_CASE_METHOD(Fixture, "a state that no driver can have counted to is not there") {
  for (const int64_t sequence : {INT64_MAX, TransitionJoiner::kMaxSequence + 1, int64_t{-1}}) {
    robot_state_t forged = State(200);
    forged.sequence = sequence;
    joiner.OnState(forged);
  }
  CHECK(joiner.newest_state() == -1);
}

TEST_CASE_METHOD(Fixture, "each transition of an episode under way is taken once") {
  States();
  for (int i = 0; i < 10; ++i) joiner.OnCommand(Command(i));
  CHECK(joiner.TakeArrived(42).size() == 9);
  CHECK(joiner.TakeArrived(42).empty());
  joint_command_t forged = Command(0);
  forged.episode = INT64_MAX;
  joiner.OnCommand(forged);
  CHECK(joiner.TakeArrived(forged.episode).empty());
  for (int i = 10; i < 20; ++i) joiner.OnCommand(Command(i));
  CHECK(joiner.TakeArrived(42).size() == 10);
  CHECK(joiner.Join(42, 300).transitions.size() == 20);
}

TEST_CASE_METHOD(Fixture, "one state that is not physical takes its own transition, and no other") {
  const std::pair<std::vector<double> robot_state_t::*, double> forgeries[] = {
      {&robot_state_t::effort, 1e150}, {&robot_state_t::effort, -21 * robot.joints[0].effort_limit},
      {&robot_state_t::q, 1e150},      {&robot_state_t::v, -1e10},
      {&robot_state_t::q_sd, 1e-160},  {&robot_state_t::v_sd, -1}};
  for (const auto& [member, value] : forgeries) {
    joiner = TransitionJoiner(robot);
    States();
    robot_state_t forged = State(130);
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
