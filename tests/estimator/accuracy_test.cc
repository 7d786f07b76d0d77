// The quick form of bench/observer: noise learnt from some motions, errors of others.

#include <catch2/catch.hpp>

#include "tests/estimator/observer_errors.h"
#include "tests/sim/robots.h"

namespace plumb {
namespace {

TEST_CASE("the smoother's velocity is five times as good as differencing at 500 Hz, and honest") {
  const std::string name = GENERATE("pendulum", "hopper");
  RobotDescription robot = WithSimulatedNoise(LoadRobot(SourceFile("robots/" + name)));
  const Recordings training = Record(robot, 1000, 2);
  const TunedNoise noise =
      TuneNoise(robot, [&](StateObserver& observer) { Play(training, observer); });
  for (size_t i = 0; i < noise.joints.size(); ++i) robot.joints[i].noise = noise.joints[i];
  const ObserverErrors errors = Observe(robot, Record(robot, 1, 4));
  for (size_t i = 0; i < errors.joints.size(); ++i) {
    const JointErrors& e = errors.joints[i];
    INFO(robot.joints[i].name << ": v " << e.differencing.v() << ", first order " << e.filtered.v()
                              << ", causal " << e.causal.v() << ", smoothed " << e.smoothed.v()
                              << "; NEES " << e.smoothed.nees_v() << ", covered "
                              << e.smoothed.covered_v());
    CHECK(5 * e.smoothed.v() < e.differencing.v());
    CHECK(e.smoothed.v() < e.causal.v());
    CHECK(e.causal.v() < e.filtered.v());
    CHECK(e.smoothed.q() < e.differencing.q());
    CHECK(e.smoothed.covered_v() > 0.85);
  }
}

}  // namespace
}  // namespace plumb
