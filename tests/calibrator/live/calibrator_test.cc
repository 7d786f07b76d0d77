#include "calibrator/live/calibrator.h"

#include <catch2/catch.hpp>

#include "tests/calibrator/motion/recorded_episode.h"

namespace plumb {
namespace {

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
    for (int i = 0; i < 20; ++i) calibrator.OnCommand(StepCommand(i));
    for (int64_t i = 90; i < 300; ++i) calibrator.OnState(SmoothedState(i));
    CHECK_FALSE(calibrator.ready());
    calibrator.OnState(SmoothedState(300));
  }
  SECTION("the states first") {
    for (int64_t i = 90; i <= 310; ++i) calibrator.OnState(SmoothedState(i));
    for (int i = 0; i < 20; ++i) calibrator.OnCommand(StepCommand(i));
    CHECK_FALSE(calibrator.ready());
    calibrator.OnControllerStatus(status);
  }
  SECTION("the driver has been started again, and counts from 0: what is lacking never comes") {
    for (int i = 0; i < 20; ++i) calibrator.OnCommand(StepCommand(i));
    for (int64_t i = 90; i < 300; ++i) calibrator.OnState(SmoothedState(i));
    robot_state_t again = SmoothedState(300);
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

}  // namespace
}  // namespace plumb
