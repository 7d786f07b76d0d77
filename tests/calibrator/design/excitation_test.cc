#include "calibrator/design/excitation.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "calibrator/motion/state_noise.h"
#include "robot/parameter_distribution.h"
#include "sim/simulator.h"
#include "tests/calibrator/fitted_log.h"

namespace plumb {
namespace {

ExcitationSettings Few(int candidates, double seconds) {
  ExcitationSettings settings;
  settings.candidates = candidates;
  settings.seconds = seconds;
  return settings;
}

}  // namespace

TEST_CASE(
    "excitations keep to the effort limits, differ from joint to joint, and come again with their "
    "seed") {
  const RobotDescription robot = Robot("double_pendulum");
  const auto a = MakeExcitations(robot, Few(61, 1)), b = MakeExcitations(robot, Few(61, 1));
  REQUIRE(a.size() == 61);
  for (size_t i = 0; i < a.size(); ++i) {
    INFO(a[i].name);
    CHECK(a[i].action.rows() == std::lround(1 / robot.task.period));
    CHECK(a[i].action.cols() == 2);
    CHECK(a[i].action.cwiseAbs().maxCoeff() <= 1);
    // of a low rate there may be none in a second
    if (a[i].name.find("impulses") == std::string::npos) {
      CHECK(a[i].action.cwiseAbs().maxCoeff() > 0.01);
      CHECK(a[i].action.col(0) != a[i].action.col(1));
    }
    CHECK(a[i].action == b[i].action);
  }
  ExcitationSettings other = Few(61, 1);
  other.seed = 2;
  CHECK(MakeExcitations(robot, other)[5].action != a[5].action);
}

TEST_CASE(
    "the best excitation tells more than random actions, and what it tells of the pendulum is two "
    "numbers") {
  const RobotDescription robot = Robot("pendulum");
  const Gaussian prior = PriorGaussian(robot);
  const auto rated = RateExcitations(robot, prior, Few(16, 5));
  REQUIRE(rated.size() > 8);
  const auto random = std::find_if(rated.begin(), rated.end(), [](const auto& r) {
    return r.excitation.name == "the task's random actions";
  });
  REQUIRE(random != rated.end());
  CHECK(rated[0].gain > random->gain + 0.5);
  for (size_t i = 1; i < rated.size(); ++i) CHECK(rated[i - 1].gain >= rated[i].gain);
  const RatedExcitation& best = rated[0];
  // gravity, mass and length along (1, -2, 1) are not told: a third of the prior's variance stays
  // with each at least.
  const Eigen::Vector3d null = Eigen::Vector3d(1, -2, 1).normalized();
  CHECK(null.dot(best.information * null) < 1e-6 * best.information.trace());
  const Eigen::Vector3d sd = prior.covariance.diagonal().cwiseSqrt();
  for (int i = 0; i < 3; ++i) {
    CHECK(best.sd(i) > 0.3 * std::abs(null(i)) * sd(i));
    CHECK(best.sd(i) < sd(i));
  }
  // The gain is that of the information: 1/2 ln det(I + S F S).
  const Eigen::Matrix3d scaled =
      Eigen::Matrix3d::Identity() +
      Eigen::Matrix3d(sd.asDiagonal() * best.information * sd.asDiagonal());
  CHECK(best.gain == Approx(0.5 * std::log(scaled.determinant())).epsilon(1e-6));
  CHECK_FALSE(DescribeGain(robot, prior, best).empty());
}

TEST_CASE("limits are kept by every simulator of the prior, or the excitation is left out") {
  RobotDescription robot = Robot("cartpole");
  robot.simulation.stop.reset();
  JointDescription& rail = robot.joints[0];
  REQUIRE(std::isfinite(rail.upper));
  const ExcitationSettings settings = Few(46, 2);
  const Gaussian prior = PriorGaussian(robot);
  const auto rated = RateExcitations(robot, prior, settings);
  RobotDescription endless = robot;
  endless.joints[0].lower = -std::numeric_limits<double>::infinity();
  endless.joints[0].upper = std::numeric_limits<double>::infinity();
  const auto unlimited = RateExcitations(endless, prior, settings);
  REQUIRE(!rated.empty());
  CHECK(rated[0].gain <= unlimited[0].gain);
  const auto unscaled = [](const std::vector<RatedExcitation>& all) {
    return std::count_if(all.begin(), all.end(), [](const auto& one) {
      return one.excitation.name.find("times") == std::string::npos;
    });
  };
  CHECK(unscaled(rated) < unscaled(unlimited));
  // Replayed in a simulator of its own: that of the mean.
  const double range = rail.upper - rail.lower;
  Simulator simulator(robot);
  const Eigen::VectorXd limits = robot.effort_limits();
  for (const RatedExcitation& one : rated) {
    CHECK(one.margin >= settings.margin);
    CHECK(one.margin < 1);
    simulator.SetParameters(robot.ToPhysical(prior.mean));
    const auto [q, v] = ExcitationStart(robot, settings.seed);
    simulator.SetState(q, v);
    Eigen::VectorXd effort = Eigen::VectorXd::Zero(2);
    double farthest = 0;
    for (Eigen::Index k = 0; k < one.steps; ++k) {
      std::vector<EffortSegment> profile = {{robot.simulation.latency, effort}};
      effort(0) = one.excitation.action(k, 0) * limits(0);
      profile.push_back({robot.task.period - robot.simulation.latency, effort});
      simulator.Step(profile);
      farthest = std::max(farthest, std::abs(simulator.q()(0)));
    }
    INFO(one.excitation.name);
    CHECK(farthest <= rail.upper - settings.margin * range + 1e-3);
    CHECK((simulator.q() - one.q.col(one.steps)).norm() < 1e-3);
  }
  rail.velocity_limit = 1e-3;
  CHECK(RateExcitations(robot, prior, settings).empty());
}

// The prior is a Gaussian of what cannot be below zero.
TEST_CASE("a belief that reaches beyond what a robot can be is drawn from where robots are") {
  RobotDescription robot = Robot("pendulum");
  robot.parameters = {
      {"damping/pivot", "Nm s/rad", ParameterDescription::Coordinate::kLinear, 0.02, 0.0004}};
  robot.virtual_robot.hidden.clear();
  for (const uint64_t seed : {1, 2, 3, 4, 5}) {
    ExcitationSettings settings = Few(4, 1);
    settings.seed = seed;
    const auto rated = RateExcitations(robot, PriorGaussian(robot), settings);
    REQUIRE(!rated.empty());
    CHECK(std::isfinite(rated[0].gain));
  }
}

TEST_CASE("of a robot that falls only what comes before counts") {
  const RobotDescription robot = Robot("hopper");
  const auto rated = RateExcitations(robot, PriorGaussian(robot), Few(6, 4));
  REQUIRE(!rated.empty());
  for (const RatedExcitation& one : rated) {
    CHECK(one.steps < 250);  // of 500
    CHECK(one.steps > 5);
    CHECK(one.q.cols() > one.steps);
  }
}

TEST_CASE("advice is for what the posterior has left open") {
  const RobotDescription robot = Robot("pendulum");
  Gaussian posterior = PriorGaussian(robot);
  Identifiability found;
  // Gravity is not known, the others are.
  posterior.covariance.diagonal().tail(2) *= 1e-6;
  found.weak = {{Eigen::Vector3d::UnitX(), 0.99}};
  const MotionAdvice advice = AdviseMotion(robot, posterior, found, Few(11, 3));
  INFO(advice.summary);
  REQUIRE(!advice.rated.empty());
  for (const RatedExcitation& one : advice.rated) CHECK(advice.rated[0].sd(0) <= one.sd(0) * 1.3);
  CHECK_THAT(advice.summary, Catch::Contains("of what is hardly determined: helps with gravity"));
  CHECK_THAT(advice.summary, Catch::Contains("hardly with mass/pole, length/pole"));
}

TEST_CASE("smoothed states are better known than measured ones, and worse with a worse sensor") {
  RobotDescription robot = Robot("pendulum");
  const Eigen::VectorXd noise = SmoothedNoise(robot);
  REQUIRE(noise.size() == 2);
  CHECK(noise(0) < robot.estimator.position_sd);
  CHECK(noise(0) > 0.1 * robot.estimator.position_sd);
  CHECK(noise(1) < robot.estimator.velocity_sd);
  CHECK(noise(1) > 1e-3);
  robot.estimator.position_sd *= 10;
  CHECK(SmoothedNoise(robot)(0) > 2 * noise(0));
  CHECK(SmoothedNoise(robot)(1) > noise(1));
  // the joint's word is the last
  robot.joints[0].noise.position_sd = robot.estimator.position_sd / 10;
  CHECK(SmoothedNoise(robot).isApprox(noise, 1e-9));
}

TEST_CASE("of a joint without a drive the velocity is less well known") {
  RobotDescription robot = Robot("hopper");
  robot.estimator.velocity_sd = 0.01;
  const int slide = robot.sensors[0].joint, thigh = robot.driven()[0];
  robot.joints[static_cast<size_t>(slide)].noise = {
      .position_sd = 1e-4, .jerk = 300, .effort_step = 1};
  robot.joints[static_cast<size_t>(thigh)].noise = {
      .position_sd = 1e-4, .jerk = 300, .effort_step = 1};
  const Eigen::VectorXd noise = SmoothedNoise(robot);
  CHECK(noise(6 + thigh) < 0.7 * noise(6 + slide));
}

TEST_CASE("without parameters or motors there is nothing to excite") {
  RobotDescription robot = Robot("pendulum");
  const Gaussian prior = PriorGaussian(robot);
  robot.virtual_robot.hidden.clear();
  robot.parameters.clear();
  CHECK_THROWS_AS(RateExcitations(robot, prior, Few(1, 1)), std::invalid_argument);
}

}  // namespace plumb
