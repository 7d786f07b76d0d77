// When a controller is silent, and what ends an episode that it may not go on with.
#include <cmath>
#include <limits>

#include "tests/controller/surroundings.h"

namespace plumb {
namespace {

TEST_CASE_METHOD(Surroundings, "it is silent until the driver is armed, then commands zero") {
  for (int i = 0; i < 50; ++i) {
    driver_state = driver_status_t::IDLE;
    CHECK_FALSE(Step());
  }
  Driver(driver_state = driver_status_t::ARMED);
  int commands = 0;
  for (int i = 0; i < 100; ++i) {
    if (const auto command = Step()) {
      ++commands;
      CHECK(command->effort[0] == 0);
      CHECK(command->episode == -1);
    }
  }
  CHECK(commands >= 9);  // one per control period of ten measurements
  CHECK(commands <= 11);
}

TEST_CASE_METHOD(Surroundings, "a state at a time that no clock shows is none") {
  Driver(driver_status_t::ARMED);
  controller.OnPolicy(Policy(0, 1, 0.5f));
  for (const int8_t phase : {S::PLACING, S::RUNNING}) {
    StepUntil(phase);
    for (const int64_t mad : {INT64_MIN, INT64_MAX, -(int64_t{1} << 54), int64_t{1} << 54}) {
      robot_state_t state = robot_state;
      state.utime = mad;
      CHECK_FALSE(controller.OnState(state, now, utime));
      CHECK(controller.phase() == phase);
    }
  }
  StepUntil(S::COMPLETE);
}

TEST_CASE_METHOD(Surroundings,
                 "doubtful states halt it: zero effort, silence, and only a re-arming leads out") {
  Driver(driver_status_t::ARMED);
  controller.OnPolicy(Policy(0, 1, 0.5f));
  StepUntil(S::RUNNING);
  for (int i = 0; i < 33; ++i) Step();
  std::optional<joint_command_t> command;
  SECTION("late") {
    now += 150'000, utime += 150'000;
    command = controller.Tick(now, utime);
  }
  SECTION("old, in quick succession, as after a stop") {
    utime += 150'000;  // the world has moved on, the states have not
    robot_state.utime = utime - 150'000 + 5000;
    ++robot_state.sequence;
    command = controller.OnState(robot_state, now + 5000, utime);
  }
  SECTION("not finite") {
    robot_state.q[0] = std::numeric_limits<double>::quiet_NaN();
    command = Step();
    robot_state.q[0] = 0;
  }
  SECTION("not valid") {
    robot_state.valid = 0;
    command = Step();
    robot_state.valid = 1;
  }
  SECTION("half a control period late") {
    now += 60'000, utime += 60'000;
    robot_state.sequence += 12;
    command = Step();
    CHECK_THAT(controller.status().reason,
               Catch::StartsWith("a state came 0.08 s after") &&
                   Catch::EndsWith("the one acted on, where the control period is 0.05 s"));
  }
  REQUIRE(controller.phase() == S::HALTED);
  REQUIRE(command);
  CHECK(command->effort[0] == 0);
  CHECK_FALSE(controller.status().reason.empty());
  CHECK(controller.status().episodes_aborted == 1);
  for (int i = 0; i < 100; ++i) CHECK_FALSE(Step());
  Driver(driver_status_t::ARMED);
  CHECK(controller.phase() == S::HALTED);
  Driver(driver_status_t::FAULT);
  CHECK(controller.phase() == S::HALTED);
  Driver(driver_status_t::ARMED);
  StepUntil(S::COMPLETE);  // the episode is run anew
  CHECK(controller.status().num_episodes == 1);
}

struct WithoutBoom : Surroundings {
  WithoutBoom() : Surroundings("robots/hopper/free.toml") {}
  void RunFor(int steps) {
    StepUntil(S::RUNNING);
    while (controller.status().step < steps) Step();
  }
  void RearmDriver() {
    Driver(driver_status_t::FAULT);
    Driver(driver_status_t::ARMED);
  }
};

TEST_CASE_METHOD(WithoutBoom, "who no longer knows where the base is has fallen") {
  Driver(driver_status_t::ARMED);
  controller.OnPolicy(Policy(0, 2));
  RunFor(20);
  const double so_far = controller.status().episode_return;
  const int64_t acted_on = robot_state.sequence;
  const robot_state_t known = robot_state;
  SECTION("not valid") { robot_state.valid = 0; }
  SECTION("begun anew") { robot_state.valid = 0, robot_state.restarted = 1; }
  SECTION("not known") { robot_state.q[1] = std::numeric_limits<double>::quiet_NaN(); }
  const auto command = Step();
  robot_state.valid = 1, robot_state.restarted = 0, robot_state.q = known.q;
  REQUIRE(command);
  CHECK(command->effort == std::vector<double>(6, 0));
  REQUIRE(controller.phase() == S::HALTED);
  const controller_status_t& status = controller.status();
  REQUIRE(status.num_episodes == 1);
  CHECK(status.fell[0] == 1);
  CHECK(status.returns[0] == so_far);
  CHECK(status.steps[0] == 19);  // of the twentieth nobody knows how it ended
  CHECK(status.last_state_sequence[0] == acted_on);
  CHECK(status.episodes_aborted == 0);
  for (int i = 0; i < 100; ++i) CHECK_FALSE(Step());
  RearmDriver();
  RunFor(5);  // the second one
  robot_state.valid = 0;
  Step();
  robot_state.valid = 1;
  CHECK(status.num_episodes == 2);
  RearmDriver();
  StepUntil(S::COMPLETE);
  CHECK(status.num_episodes == 2);
}

TEST_CASE_METHOD(WithoutBoom, "a late state, or one lost before the first step's end, is no fall") {
  Driver(driver_status_t::ARMED);
  controller.OnPolicy(Policy(0));
  SECTION("late") {
    RunFor(20);
    now += 150'000, utime += 150'000;
    controller.Tick(now, utime);
  }
  SECTION("lost at once") {
    RunFor(1);
    robot_state.valid = 0;
    Step();
    robot_state.valid = 1;
  }
  REQUIRE(controller.phase() == S::HALTED);
  CHECK(controller.status().num_episodes == 0);
  CHECK(controller.status().episodes_aborted == 1);
}

TEST_CASE_METHOD(Surroundings,
                 "a driver that disarms ends the episode; a silent driver counts as absent") {
  Driver(driver_status_t::ARMED);
  controller.OnPolicy(Policy(0));
  StepUntil(S::RUNNING);
  SECTION("disarms") { Driver(driver_state = driver_status_t::FAULT); }
  SECTION("falls silent") {
    for (int i = 0; i < 300; ++i) {
      now += 5000, utime += 5000;
      ++robot_state.sequence;
      robot_state.utime = utime;
      controller.OnState(robot_state, now, utime);
      controller.Tick(now, utime);
    }
    driver_state = driver_status_t::ABSENT;
  }
  CHECK(controller.phase() == S::WAITING);
  CHECK(controller.status().episodes_aborted == 1);
  CHECK_FALSE(Step());
}

TEST_CASE_METHOD(Surroundings,
                 "a driver that was not heard for a while is none that has been disarmed") {
  Driver(driver_status_t::ARMED);
  controller.OnPolicy(Policy(0, 1, 0.5f));
  StepUntil(S::RUNNING);
  robot_state.valid = 0;
  Step();
  robot_state.valid = 1;
  REQUIRE(controller.phase() == S::HALTED);
  now += 1'500'000, utime += 1'500'000;
  controller.Tick(now, utime);
  Driver(driver_status_t::ARMED);
  CHECK(controller.phase() == S::HALTED);
  for (int i = 0; i < 100; ++i) CHECK_FALSE(Step());
  Driver(driver_status_t::IDLE);
  Driver(driver_status_t::ARMED);
  StepUntil(S::COMPLETE);
}

TEST_CASE_METHOD(Surroundings, "after an episode that was aborted the newest policy runs") {
  Driver(driver_status_t::ARMED);
  controller.OnPolicy(Policy(0, 1, 0.5f));
  StepUntil(S::RUNNING);
  controller.OnPolicy(Policy(1, 1, 0.25f));
  robot_state.valid = 0;
  Step();
  robot_state.valid = 1;
  Driver(driver_status_t::FAULT);
  Driver(driver_status_t::ARMED);
  StepUntil(S::PLACING);
  CHECK(controller.status().policy_iteration == 1);
}

}  // namespace
}  // namespace plumb
