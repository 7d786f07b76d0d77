// Calibration through the whole chain: virtual robot, frames on its bus, driver, observer. Quick
// form of bench/observed_calibration.

#include <catch2/catch.hpp>
#include <cmath>

#include "calibrator/fit/methods.h"
#include "tests/calibrator/fitted_log.h"
#include "tests/calibrator/hop_on_bus.h"

namespace plumb {
namespace {

struct Answer {
  Eigen::VectorXd error, sd;  // of the masses, relative
  double discrepancy;         // 1 = down to the noise
};

Answer Calibrated(const RobotDescription& robot, const std::vector<Samples>& motions, States states,
                  uint32_t seed) {
  const Log log = ObservedLog(robot, motions, states);
  CalibrationOptions options;
  options.method = "laplace";
  options.horizons = {1};
  const MethodResult result =
      RunMethod({std::make_shared<const Model>(robot), log.rollouts, options});
  const Gaussian posterior = Moments(result.posterior);
  return {posterior.mean - HiddenParameters(robot, seed).array().log().matrix(),
          posterior.covariance.diagonal().cwiseSqrt(), result.curriculum->stages.at(0).discrepancy};
}

TEST_CASE(
    "a hopper's masses are found through its bus as well as the posterior says; errors in "
    "variables are part of "
    "the noise") {
  RobotDescription robot = Robot("hopper");
  robot.estimator.delay = 0;  // here frames arrive at once
  double unexplained = 0, unexplained_if_exact = 0;
  for (const uint32_t seed : {1, 2}) {
    const Samples motion = HopOnBus(robot, seed);
    REQUIRE(motion.size() > 900);
    const Answer truth = Calibrated(robot, {motion}, States::kTrue, seed);
    CHECK(truth.error.cwiseAbs().maxCoeff() < 1e-3);
    const Answer found = Calibrated(robot, {motion}, States::kSmoothed, seed);
    INFO("errors " << found.error.transpose() << ", claimed " << found.sd.transpose());
    CHECK((found.error.array().abs() < 3 * found.sd.array()).all());
    CHECK(found.sd(0) < 0.02);
    const Answer sure = Calibrated(robot, {motion}, States::kCertain, seed);
    unexplained += found.discrepancy / 2;
    unexplained_if_exact += sure.discrepancy / 2;
  }
  INFO("mean squared whitened error " << unexplained << ", states taken for exact "
                                      << unexplained_if_exact);
  CHECK(unexplained < 1);
  CHECK(unexplained_if_exact > 2 * unexplained);
}

TEST_CASE("driven into its stops and into the ground a hopper's masses are found all the same") {
  RobotDescription robot = Robot("hopper");
  robot.estimator.delay = 0;
  constexpr uint32_t kSeed = 1;
  const std::vector<Samples> motions = BangBangOnBus(robot, kSeed);
  const Answer found = Calibrated(robot, motions, States::kSmoothed, kSeed);
  INFO("errors " << found.error.transpose() << ", claimed " << found.sd.transpose());
  CHECK((found.error.array().abs() < 4 * found.sd.array()).all());
  CHECK(found.sd(0) < 0.01);
  CHECK(found.discrepancy < 1.6);
  // Without impacts states are further off than they say.
  for (JointDescription& joint : robot.joints)
    joint.noise.ground_impact = joint.noise.stop_impact = 0;
  CHECK(Calibrated(robot, motions, States::kSmoothed, kSeed).discrepancy > 10);
}

}  // namespace
}  // namespace plumb
