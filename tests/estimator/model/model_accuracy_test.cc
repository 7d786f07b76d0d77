// The quick form of bench/model_observer.

#include <catch2/catch.hpp>

#include "tests/estimator/model/model_errors.h"
#include "tests/sim/allocations.h"
#include "tests/sim/robots.h"

namespace plumb {
namespace {

struct Motion {
  explicit Motion(const std::string& name)
      : robot(WithSimulatedNoise(LoadRobot(SourceFile("robots/" + name)))),
        recordings(Record(robot, 1, 2)) {}

  RobotDescription AssumedWith(double mass, double acceleration) const {
    RobotDescription assumed = Assumed(robot, mass);
    assumed.estimator.model_acceleration = acceleration;
    return assumed;
  }

  RobotDescription robot{};
  Recordings recordings;
};

TEST_CASE(
    "with the right dynamics, velocities are half as good again as the kinematic filter's or more, "
    "through "
    "impacts, too") {
  const Motion motion(GENERATE("pendulum", "hopper", "hopper/gym.toml"));
  const ModelErrors errors = Compare(motion.robot, Assumed(motion.robot), motion.recordings);
  for (size_t i = 0; i < errors.model.size(); ++i) {
    INFO(motion.robot.joints[i].name << ": v " << errors.kinematic[i].v() << ", on the model "
                                     << errors.model[i].v() << ", NEES " << errors.model[i].nees_v()
                                     << "; q " << errors.kinematic[i].q() << ", "
                                     << errors.model[i].q());
    CHECK(1.5 * errors.model[i].v() < errors.kinematic[i].v());
    CHECK(errors.model[i].q() < 1.2 * errors.kinematic[i].q());
    CHECK(errors.model[i].nees_v() < 2);
  }
  CHECK(errors.restarts == 0);
}

// Why calibration may not use it: what it assumed is in its states.
TEST_CASE(
    "with masses 30 % too great it is worse than with the right ones, and than what calibration "
    "has of some "
    "joint") {
  const Motion motion(GENERATE("pendulum", "hopper"));
  const ObserverErrors observed = Observe(motion.robot, motion.recordings);
  const ModelErrors right = Compare(motion.robot, motion.AssumedWith(1, 0.2), motion.recordings);
  const ModelErrors wrong = Compare(motion.robot, motion.AssumedWith(1.3, 0.2), motion.recordings);
  double more_than_right = 0, more_than_smoothed = 0;
  for (size_t i = 0; i < wrong.model.size(); ++i) {
    INFO(motion.robot.joints[i].name << ": v " << right.model[i].v() << ", wrong "
                                     << wrong.model[i].v() << ", smoothed "
                                     << observed.joints[i].smoothed.v());
    CHECK(wrong.model[i].v() > 1.2 * right.model[i].v());
    more_than_right = std::max(more_than_right, wrong.model[i].v() / right.model[i].v());
    more_than_smoothed =
        std::max(more_than_smoothed, wrong.model[i].v() / observed.joints[i].smoothed.v());
  }
  CHECK(more_than_right > 1.5);
  CHECK(more_than_smoothed > 1.4);
}

TEST_CASE("taken at its word, a wrong model is worse than none, a right one better still") {
  const Motion motion(GENERATE("pendulum", "hopper"));
  const ModelErrors right = Compare(motion.robot, motion.AssumedWith(1, 0.005), motion.recordings);
  const ModelErrors wrong =
      Compare(motion.robot, motion.AssumedWith(1.3, 0.005), motion.recordings);
  for (size_t i = 0; i < wrong.model.size(); ++i) {
    INFO(motion.robot.joints[i].name << ": v " << right.kinematic[i].v() << ", on the right model "
                                     << right.model[i].v() << ", on the wrong one "
                                     << wrong.model[i].v());
    CHECK(wrong.model[i].v() > 1.2 * wrong.kinematic[i].v());
    CHECK(right.model[i].v() < 0.5 * right.kinematic[i].v());
    CHECK(wrong.model[i].nees_v() > 10);
  }
}

TEST_CASE(
    "a thousand steps of a hopper, impacts, unknown efforts and failures among them, allocate "
    "nothing") {
  const Motion motion("hopper");
  RobotDescription assumed = Assumed(motion.robot);
  assumed.joints[4].dynamics.delay = 0.007;
  StateObserver observer(motion.robot);
  UnscentedObserver model(assumed);
  int64_t counted = 0, steps = 0;
  for (SimulatedReadings::Sample sample : motion.recordings.front()) {
    if (steps % 100 == 50) sample.joints.effort_applied[3] = NAN;
    observer.OnJointState(sample.joints);
    robot_state_t kinematic = observer.state();
    if (steps % 100 == 70) kinematic.valid = false;
    if (steps % 100 == 71) kinematic.v[2] = 1e9;  // taken over; nothing comes of it
    const int64_t before = Allocations();
    model.OnJointState(sample.joints, kinematic);
    if (++steps > 1) counted += Allocations() - before;
  }
  CHECK(steps > 990);
  CHECK(model.restarts() >= 9);
  CHECK(counted == 0);
}

}  // namespace
}  // namespace plumb
