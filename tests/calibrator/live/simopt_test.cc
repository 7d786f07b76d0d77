#include "calibrator/live/simopt.h"

#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "common/special_numbers.h"
#include "robot/parameter_distribution.h"
#include "sim/simulator.h"
#include "tests/calibrator/live/known_pendulum.h"
#include "tests/calibrator/synthetic.h"

namespace plumb {
namespace {

TEST_CASE("the true parameters explain synthetic transitions down to the noise") {
  const RobotDescription robot = Pendulum();
  Discrepancy discrepancy(robot);
  const std::vector<Rollout> rollouts{SyntheticRollout(robot, kTruth, 2000, 1e-4, 0.01, 1)};
  // 4000 squared standard normals: 1 +- 0.0224
  CHECK(discrepancy.StepError(kTruth, rollouts)(0) == Approx(1).margin(0.07));
  CHECK(discrepancy.StepError(Eigen::Vector3d(10, 1, 1), rollouts)(0) > 1.5);
  const Eigen::VectorXd r = discrepancy.Residuals(kTruth, rollouts);
  CHECK(discrepancy.StepError(kTruth, rollouts)(0) == Approx(r.squaredNorm() / 4000));
  // the density of a two-dimensional Student's t distribution with four degrees of freedom
  double t = 0;
  for (Eigen::Index i = 0; i < r.size(); i += 2)
    t += std::log(std::pow(1 + r.segment(i, 2).squaredNorm() / 4, -3));
  CHECK(discrepancy.LogLikelihood(kTruth, rollouts)(0) == Approx(t));
}

TEST_CASE(
    "without noise every horizon is predicted exactly, and errors grow with the horizon "
    "otherwise") {
  const RobotDescription robot = Pendulum();
  Discrepancy discrepancy(robot);
  std::vector<Rollout> rollouts{SyntheticRollout(robot, kTruth, 60, 0, 0, 1)};
  for (const int n : {1, 5, 20}) CHECK(discrepancy.PredictionError(kTruth, rollouts, n)(0) < 1e-9);
  CHECK(discrepancy.TrajectoryError(kTruth, rollouts)(0) < 1e-9);
  const Eigen::Vector3d wrong(10, 1, 1);
  CHECK(discrepancy.PredictionError(wrong, rollouts, 5)(0) >
        2 * discrepancy.PredictionError(wrong, rollouts, 1)(0));
  CHECK(discrepancy.TrajectoryError(wrong, rollouts)(0) > 0.01);
  CHECK(std::isnan(discrepancy.PredictionError(wrong, rollouts, 61)(0)));
  // 30 + 29 remain, no window of 31
  rollouts[0].transitions.erase(rollouts[0].transitions.begin() + 30);
  CHECK(std::isnan(discrepancy.PredictionError(wrong, rollouts, 31)(0)));
  CHECK(discrepancy.TrajectoryError(kTruth, rollouts)(0) < 1e-9);
}

TEST_CASE("a replay goes from each stretch's first state to its end, with what was applied") {
  const RobotDescription robot = Pendulum();
  Discrepancy discrepancy(robot);
  std::vector<Rollout> rollouts{SyntheticRollout(robot, kTruth, 60, 0, 0, 1)};
  CHECK(discrepancy.ReplayError(kTruth, rollouts)(0) < 1e-12);
  auto& transitions = rollouts[0].transitions;
  transitions.erase(transitions.begin() + 25);
  transitions[40].next_q[0] = kNaN;
  const Eigen::Vector3d wrong(10, 1, 1);
  Simulator simulator(robot);
  simulator.SetParameters(wrong);
  double squares = 0;
  for (size_t i = 0; i < transitions.size(); ++i) {
    if (i == 0 || i == 25) simulator.SetState(transitions[i].q, transitions[i].v);
    simulator.Step(transitions[i].efforts);
    if (i != 40) squares += std::pow(simulator.q()[0] - transitions[i].next_q[0], 2);
  }
  CHECK(squares > 1e-3);
  CHECK(discrepancy.ReplayError(wrong, rollouts)(0) == Approx(squares / 58));
  CHECK(std::isnan(discrepancy.ReplayError(wrong, std::span<const Rollout>())(0)));
}

TEST_CASE(
    "the distribution comes to rest on the posterior: neither collapsed nor forgetting its prior") {
  RobotDescription robot = Pendulum();
  robot.calibration.updates = 12;
  SimOpt simopt(robot, 4, 2);
  Iterate(simopt, robot, 6);
  const Gaussian found = Moments(simopt.state().distribution);

  // Independent truth: the Laplace approximation of the same posterior, by Gauss-Newton from the
  // true parameters.
  const Gaussian laplace = LaplacePosterior(robot, simopt.state().rollouts, kTruth.array().log());
  const Eigen::VectorXd& x = laplace.mean;
  const Eigen::MatrixXd& covariance = laplace.covariance;
  for (const Eigen::Vector3d& power : {kGravityOverLength, kMassLengthSquared}) {
    const double sd = std::sqrt(power.dot(covariance * power));
    CHECK(std::abs(power.dot(found.mean - x)) < 1.2 * sd);
    const double ratio = std::sqrt(power.dot(found.covariance * power)) / sd;
    CHECK(ratio > 0.5);
    CHECK(ratio < 2);
    CHECK(std::abs(power.dot(found.mean) - LogTruth(power)) < 0.01);  // 1 %
  }
  // Where the data say nothing the prior stays.
  const Eigen::Vector3d along = kNull.normalized();
  const double null_ratio = along.dot(found.covariance * along) / along.dot(covariance * along);
  CHECK(null_ratio > 0.3);
  CHECK(null_ratio < 3);
}

TEST_CASE("one wrecked transition in a hundred does not move the distribution") {
  const RobotDescription robot = Pendulum();
  SimOpt simopt(robot, 4, 2);
  for (uint32_t i = 0; i < 10; ++i) {
    Rollout rollout = SyntheticRollout(robot, kTruth, 100, 1e-4, 0.01, i);
    rollout.transitions[40].next_v(0) += 2;  // 140 standard deviations
    simopt.Begin({rollout});
    Finish(simopt);
  }
  for (const Eigen::Vector3d& power : {kGravityOverLength, kMassLengthSquared}) {
    CHECK(std::abs(power.dot(Moments(simopt.state().distribution).mean) - LogTruth(power)) < 0.01);
  }
}

TEST_CASE("what the motion determines is found and said in words") {
  const RobotDescription robot = Pendulum();
  SimOpt simopt(robot, 1, 1);
  simopt.Begin({SyntheticRollout(robot, kTruth, 100, 1e-4, 0.01, 1)});
  const Identifiability found = Finish(simopt).identifiability;
  REQUIRE(found.null.size() == 1);
  CHECK((found.null[0] - kNull).norm() < 1e-3);
  REQUIRE(found.combinations.size() == 2);
  CHECK(found.combinations[0].name == "gravity / length");
  CHECK(found.combinations[1].name == "mass length^2");
  CHECK(found.summary ==
        "only gravity / length and mass length^2 can be known from this motion; gravity, mass, "
        "length are not "
        "identifiable separately: (gravity +1 %, mass -2 %, length +1 %) changes nothing");
}

TEST_CASE("every update keeps to the KL bound") {
  const RobotDescription robot = Pendulum();
  for (const Objective objective :
       {Objective::kPosterior, Objective::kStep, Objective::kTrajectory}) {
    SimOpt simopt(robot, 2, 1, objective);
    simopt.Begin({SyntheticRollout(robot, kTruth, 50, 1e-4, 0.01, 1)});
    Gaussian before = Moments(simopt.state().distribution);
    bool last = false;
    for (int update = 0; !last; ++update) {
      REQUIRE(update < 100);
      last = simopt.Update().has_value();
      CHECK(KlDivergence(Moments(simopt.state().distribution), before) <=
            robot.calibration.kl * (1 + 1e-9));
      before = Moments(simopt.state().distribution);
    }
  }
}

TEST_CASE("an iteration without a usable transition goes by and invents nothing") {
  const RobotDescription robot = Pendulum();
  for (const Objective objective :
       {Objective::kPosterior, Objective::kStep, Objective::kTrajectory}) {
    SimOpt simopt(robot, 1, 1, objective);
    CHECK_FALSE(simopt.Report());
    simopt.Begin({Rollout{}});
    CHECK_THROWS_AS(simopt.Begin({Rollout{}}), std::invalid_argument);
    const CalibrationReport report = Finish(simopt);
    CHECK(report.iteration == 1);
    CHECK(std::isnan(report.discrepancy));
    CHECK(report.identifiability.combinations.empty());
    CHECK(KlDivergence(Moments(simopt.state().distribution), PriorGaussian(robot)) ==
          Approx(0).margin(1e-12));
  }
}

TEST_CASE(
    "an inference lets an iteration without usable transitions go by, and an unknown method is "
    "refused") {
  const RobotDescription robot = Pendulum();
  SimOpt simopt(robot, 1, 1, "auto");
  simopt.Begin({Rollout{}});
  auto report = simopt.Update();
  REQUIRE(report);
  CHECK(KlDivergence(Moments(simopt.state().distribution), PriorGaussian(robot)) ==
        Approx(0).margin(1e-12));
  CHECK_THAT(simopt.state().gap, Catch::Contains("no motion has been recorded"));
  Rollout unseen = Synthetic(robot, 1);
  for (Transition& t : unseen.transitions) t.next_q(0) = t.next_v(0) = NAN;
  simopt.Begin({unseen});
  report = simopt.Update();
  REQUIRE(report);
  REQUIRE(report->warnings.size() == 1);
  CHECK_THAT(report->warnings[0], Catch::Contains("stays as it is"));
  CHECK(simopt.state().gap == report->warnings[0]);  // whether it explains this nobody can tell
  CHECK_FALSE(simopt.state().explained);
  simopt.Begin({Synthetic(robot, 2)});
  CHECK(simopt.Update());
  CHECK(simopt.state().iteration == 3);
  CHECK(simopt.state().kl > 1);
  CHECK_THAT(simopt.state().gap, !Catch::Contains("stays as it is"));
  CHECK_THROWS_WITH(SimOpt(robot, 1, 1, "laplas"), Catch::Contains("did you mean 'laplace'"));
}

}  // namespace
}  // namespace plumb
