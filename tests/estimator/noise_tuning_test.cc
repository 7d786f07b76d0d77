#include "estimator/noise_tuning.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "common/random.h"

namespace plumb {
namespace {

RobotDescription TunedRobot() {
  RobotDescription robot{};
  robot.joints.resize(1);
  robot.joints[0].name = "pivot";
  robot.joints[0].effort_limit = 2;
  robot.estimator = {.position_sd = 1e-2,
                     .velocity_sd = 1,
                     .jerk = 1000,
                     .effort_step = 0,
                     .timing_sd = 0,
                     .lag = 4,
                     .reset_after = 100};
  return robot;
}

// A motion that is what the filter assumes, white jerk, sampled exactly.
// @param placed whether somebody puts the robot elsewhere every second, and whether that is told.
enum class Placed { kNever, kTold, kUntold };
void Play(StateObserver& observer, double position_sd, double velocity_sd, double jerk, int steps,
          Placed placed = Placed::kNever) {
  Random random(3, {7});
  constexpr double kSub = 1e-4;
  double q = 0, v = 0, a = 0;
  for (int k = 0; k < steps; ++k) {
    if (placed != Placed::kNever && k % 200 == 199) {
      q = 0.2 * random.Normal(), v = a = 0;
      if (placed == Placed::kTold) observer.Place();
    }
    for (int i = 0; i < 50; ++i) {
      q += kSub * v;
      v += kSub * a;
      // stays within reach
      a += jerk * std::sqrt(kSub) * random.Normal() - kSub * (20 * a + 100 * v + 100 * q);
    }
    joint_state_t m{};
    m.utime = 1'000'000 + 5000 * k;
    m.sequence = k;
    m.num_joints = 1;
    m.measured = {m.utime};
    m.position = {q + position_sd * random.Normal()};
    m.velocity = {v + velocity_sd * random.Normal()};
    m.effort_measured = m.effort_sent = m.effort_applied = {0.0};
    m.valid = {1};
    observer.OnJointState(m);
  }
}

TEST_CASE("known noise is found, far from where the search begins") {
  const TunedNoise tuned = TuneNoise(
      TunedRobot(), [](StateObserver& observer) { Play(observer, 1e-3, 0.05, 40, 6000); });
  CHECK(tuned.joints[0].position_sd == Approx(1e-3).epsilon(0.15));
  CHECK(tuned.joints[0].velocity_sd == Approx(0.05).epsilon(0.15));
  CHECK(tuned.joints[0].jerk == Approx(40).epsilon(0.3));
  CHECK(tuned.joints[0].effort_step == 0);  // there was none to learn from
  CHECK(tuned.after[0] < tuned.before[0] - 1);
}

TEST_CASE("where a robot is put between episodes is no motion to learn noise from") {
  const auto tuned = [](Placed placed) {
    return TuneNoise(TunedRobot(),
                     [=](StateObserver& observer) { Play(observer, 1e-3, 0.05, 40, 4000, placed); })
        .joints[0];
  };
  CHECK(tuned(Placed::kTold).position_sd == Approx(1e-3).epsilon(0.2));
  CHECK(tuned(Placed::kTold).jerk == Approx(40).epsilon(0.3));
  const NoiseDescription untold = tuned(Placed::kUntold);
  CHECK((untold.position_sd > 2e-3 || untold.jerk > 100));  // or telling would not matter
}

TEST_CASE("too little to learn from is refused by name") {
  CHECK_THROWS_WITH(
      TuneNoise(TunedRobot(), [](StateObserver& observer) { Play(observer, 1e-3, 0.05, 40, 50); }),
      Catch::Contains("joint pivot") && Catch::Contains("too few"));
}

}  // namespace
}  // namespace plumb
