#include "calibrator/gap/disturbances.h"

#include <catch2/catch.hpp>
#include <limits>

#include "calibrator/fit/methods.h"
#include "calibrator/gap/gap.h"
#include "robot/parameter_distribution.h"
#include "sim/parameters.h"
#include "sim/touch.h"
#include "tests/calibrator/fitted_log.h"
#include "tests/calibrator/hopper.h"

namespace plumb {
namespace {

// How far the masses are from the truth, in units of what the fit claims.
double Farthest(const RobotDescription& robot, std::span<const Rollout> steps) {
  CalibrationOptions options;
  options.method = "laplace", options.horizons = {1};
  const Gaussian posterior =
      Moments(RunMethod({std::make_shared<Model>(robot), steps, options}).posterior);
  const Eigen::ArrayXd truth = HiddenParameters(robot, 3).array().log();
  return ((posterior.mean.array() - truth) / posterior.covariance.diagonal().array().sqrt())
      .abs()
      .maxCoeff();
}

}  // namespace

TEST_CASE("with contacts set aside, touching steps of a wrong ground give the right masses") {
  const RobotDescription robot = Hopper();
  const Truth softer{{{"contact/stiffness", 0.1 * robot.simulation.contact->stiffness}}};
  std::vector<Rollout> touching = RandomLog(robot, softer, 1000, 3);
  for (Rollout& rollout : touching) {
    std::erase_if(rollout.transitions,
                  [&, finder = TouchFinder(robot, 0.01)](const Transition& t) mutable {
                    return !finder.Find(t.q).ground || !finder.Find(t.next_q).ground;
                  });
  }
  REQUIRE(CountTransitions(touching) > 200);
  const auto model = std::make_shared<Model>(robot);
  const std::vector<Rollout> disturbed =
      DisturbedByContacts(model, HiddenParameters(robot, 3), touching);
  REQUIRE(CountTransitions(disturbed) == CountTransitions(touching));
  const double wrong = Farthest(robot, touching), right = Farthest(robot, disturbed);
  CHECK(right < 5);  // before what else may be wrong widens it
  CHECK(wrong > 3 * right);
}

TEST_CASE("steps that touch nothing are not disturbed, and what nobody saw whole is left out") {
  const RobotDescription robot = Hopper();
  std::vector<Rollout> log = RandomLog(robot, {}, 300, 3);
  log[0].transitions[1].next_v(2) = std::numeric_limits<double>::quiet_NaN();
  const auto model = std::make_shared<Model>(robot);
  const std::vector<Rollout> disturbed =
      DisturbedByContacts(model, HiddenParameters(robot, 3), log);
  CHECK(CountTransitions(disturbed) == CountTransitions(log) - 1);
  const size_t free = CountTransitions(FreeSteps(robot, disturbed));
  size_t undisturbed = 0;
  for (const Rollout& rollout : disturbed) {
    for (const Transition& t : rollout.transitions) {
      undisturbed += t.disturbance.cols() == 0;
      if (t.disturbance.cols() > 0) CHECK(t.disturbance.rows() == 2 * robot.num_velocities());
    }
  }
  CHECK(free > 0);
  CHECK(undisturbed >= free * 9 / 10);  // the simulator's step may touch where the record does not
  CHECK(undisturbed < CountTransitions(disturbed));
}

}  // namespace plumb
