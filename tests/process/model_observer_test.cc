// plumb-estimator with and without the simulator's dynamics, over LCM.

#include <cmath>

#include "plumb/joint_state_t.hpp"
#include "tests/process/stage.h"

namespace plumb {
namespace {

using Catch::Contains;

/// States of a pendulum that hangs, every 5 ms, until the estimator's answer is valid.
struct Answer {
  explicit Answer(Stage& stage)
      : causal(stage.messenger, "ROBOT_STATE"), smoothed(stage.messenger, "ROBOT_STATE_SMOOTHED") {
    Publisher<joint_state_t> readings(stage.messenger, "JOINT_STATE");
    joint_state_t m{};
    m.num_joints = 1;
    m.position = {M_PI};
    m.velocity = m.effort_measured = m.effort_sent = m.effort_applied = {0.0};
    m.valid = {1};
    const auto both = [&] { return smoothed.received() > 0 && smoothed.newest().valid; };
    for (int k = 0; k < 4000 && !both(); ++k) {
      m.utime = 1'000'000 + 5000 * k;
      m.measured = {m.utime};
      m.sequence = k;
      readings.Publish(m);
      stage.Listen(0.005);
    }
    REQUIRE(both());
  }
  Subscriber<robot_state_t> causal, smoothed;
};

TEST_CASE("the causal state says that it is model-based, the smoothed one never is") {
  Stage stage(90);
  SECTION("with --model") {
    stage.Start("plumb-estimator", {"--model", "nominal"});
    Answer answer(stage);
    CHECK(answer.causal.newest().model_based);
    CHECK_FALSE(answer.smoothed.newest().model_based);
    CHECK(answer.causal.newest().q[0] == Approx(M_PI).margin(1e-3));
  }
  SECTION("without") {
    stage.Start("plumb-estimator");
    Answer answer(stage);
    CHECK_FALSE(answer.causal.newest().model_based);
    CHECK_FALSE(answer.smoothed.newest().model_based);
  }
}

TEST_CASE("a model that cannot be had is one clear line") {
  Stage stage(91);
  Child& estimator = stage.Start("plumb-estimator", {"--model", "/nowhere/posterior.json"});
  stage.WaitUntil([&] { return !stage.coordinator->present("plumb-estimator"); }, 1);
  REQUIRE(estimator.WaitFor(60));
  CHECK(estimator.failed());
  CHECK_THAT(estimator.Tail(5), Contains("/nowhere/posterior.json: there is no such file"));
}

}  // namespace
}  // namespace plumb
