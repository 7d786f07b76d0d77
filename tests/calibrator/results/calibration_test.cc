#include "calibrator/results/calibration.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <stdexcept>

#include "calibrator/diagnostics/holdout.h"
#include "common/decompositions.h"
#include "tests/calibrator/fitted_log.h"
#include "tests/calibrator/hopper.h"
#include "tests/calibrator/inference/statistics.h"
#include "tests/calibrator/results/swinging.h"
#include "tests/calibrator/synthetic.h"

namespace plumb {
namespace {

TEST_CASE("a model is not judged by velocities that are differences of positions") {
  std::vector<Log> logs{Swinging("a", kSwingingTruth, 3, 0)};
  logs[0].differenced = {"pivot"};
  const Findings f = Of(logs, "laplace");
  CHECK_FALSE(f.misspecification.alarm);
  CHECK_FALSE(f.misspecification.judged);
  CHECK_THAT(f.misspecification.summary, Catch::Contains("nobody has read the velocities"));
  // Whoever needs velocities takes them for read.
  const Findings reps = Of(logs, "reps");
  CHECK_FALSE(reps.misspecification.judged);
  CHECK_THAT(reps.misspecification.summary,
             Catch::StartsWith("the model is not judged: v/pivot is made of differences"));
}

TEST_CASE("a pendulum's calibration finds what the motion tells, and names what it does not") {
  const Findings f = Of({Swinging("a", kSwingingTruth, 6, 0)});
  CHECK(f.used == "laplace");
  CHECK(f.transitions == 360);
  // gravity / length and mass length^2 to a few standard deviations, both well known.
  const Eigen::Vector3d slow(1, 0, -1), heavy(0, 1, 2), null(1, -2, 1);
  const Gaussian posterior = Moments(f.posterior);
  for (const Eigen::Vector3d& known : {slow, heavy}) {
    const double sd = std::sqrt(known.dot(posterior.covariance * known));
    CHECK(sd < 0.02);
    CHECK(std::abs(known.dot(posterior.mean) -
                   known.dot(Eigen::Vector3d(kSwingingTruth.array().log()))) < 4 * sd);
  }
  REQUIRE(f.identifiability.null.size() == 1);
  CHECK((f.identifiability.null[0].normalized().cwiseAbs() - null.normalized().cwiseAbs()).norm() <
        0.02);
  REQUIRE(f.identifiability.combinations.size() == 2);
  CHECK(f.cramer_rao.array().isInf().all());
  // Along the null direction, relative to the prior's metric, samples are the prior's.
  const Eigen::Vector3d across = Inverse(f.prior.covariance) * null;
  const Eigen::VectorXd along = (f.samples.array().log().matrix().transpose() * across).eval();
  CHECK(f.samples.cols() == 1000);
  CHECK(KolmogorovSmirnov(along, across.dot(f.prior.mean),
                          std::sqrt(across.dot(f.prior.covariance * across))) > 0.01);
  // Noise that nobody had told, and errors down to it.
  CHECK(f.noise_sd(0) == Approx(1e-3).epsilon(0.2));
  CHECK(f.noise_sd(1) == Approx(5e-3).epsilon(0.2));
  CHECK(f.rows.size() == static_cast<size_t>(f.errors.size()));
  CHECK_FALSE(f.misspecification.alarm);
  CHECK(f.holdout.better);
  CHECK(f.holdout.held_out == 60);
  CHECK(f.holdout.fitted == 300);
  CHECK(f.holdout.errors[0].prior > 1.3 * f.holdout.errors[0].posterior);
  CHECK(f.holdout.errors[5].prior > 4 * f.holdout.errors[5].posterior);
  CHECK(f.agreement.agree);
  CHECK(f.failures == 0);
}

TEST_CASE("the world's mass has no effect, which is said, and keeps its prior") {
  const RobotDescription robot = Hopper("/paper.toml");
  Eigen::VectorXd truth(5);
  truth << RandomMasses(Hopper(), 3), 1;
  Log log;
  log.name = "hopper";
  log.rollouts = RandomRollouts(robot, truth, 300, 1e-5, 3);
  CalibrationOptions options;
  options.horizons = {1, 5};
  const Findings f = Calibrate(robot, std::vector<Log>{log}, options);
  REQUIRE(f.identifiability.null.size() == 1);
  CHECK((f.identifiability.null[0].cwiseAbs() - Eigen::VectorXd::Unit(5, 4)).norm() < 1e-6);
  CHECK(f.identifiability.summary.find("mass/world") != std::string::npos);
  CAPTURE(f.identifiability.summary);
  const double mean = f.prior.mean(4), sd = std::sqrt(f.prior.covariance(4, 4));
  CHECK(KolmogorovSmirnov(f.samples.row(4).transpose().array().log(), mean, sd) > 0.01);
  CHECK(Moments(f.posterior).mean(4) == Approx(mean).margin(0.02 * sd));
  CHECK(std::isinf(f.cramer_rao(4)));
  CHECK(f.cramer_rao.head(4).maxCoeff() < 0.1);
  const Eigen::ArrayXd off =
      Moments(f.posterior).mean.head(4).array() - truth.head(4).array().log();
  CHECK((off.abs() / Moments(f.posterior).covariance.diagonal().head(4).array().sqrt()).maxCoeff() <
        4);
}

TEST_CASE("parameters that nothing informs are not determined, and what is lacking is learnt") {
  const RobotDescription robot = Robot("pendulum/gym.toml");
  const Truth friction{{{"friction/pivot", 0.5}}, 0, 1e-3};
  std::vector<Log> logs(2);
  for (Log& log : logs)
    log.name = "a log", log.rollouts = RandomLog(robot, friction, 300, logs[0].rollouts.size() + 3);
  CalibrationOptions options;
  options.horizons = {1};
  const Findings f = Calibrate(robot, logs, options);
  CHECK(f.misspecification.alarm);
  CHECK(f.gap.informed == Informed::kNone);
  REQUIRE(f.gap.residual);
  CHECK(Explained(f.gap.free)(0) > 0.5);
  CHECK(f.gap.summary.find("train on posterior and residual together") != std::string::npos);
  CHECK(f.identifiability.summary.find("no parameter is determined") != std::string::npos);
  CHECK(f.cramer_rao.array().isInf().all());
  CHECK(Moments(f.posterior).mean == f.prior.mean);
  CHECK_FALSE(f.holdout.better);
  CHECK(f.agreement.logs.empty());

  options.residual = false;
  const Findings alone = Calibrate(robot, logs, options);
  CHECK(alone.misspecification.summary == f.misspecification.summary);
  CHECK(alone.gap.informed == Informed::kAll);
  CHECK_FALSE(alone.gap.residual);
  CHECK(alone.identifiability.combinations.size() == 2);
  CHECK(alone.agreement.logs.size() == 2);
}

TEST_CASE("noise alone raises the alarm, and teaches hardly anything") {
  Log log = Swinging("noise", kSwingingTruth, 6, 20);
  Random random(3);
  for (Rollout& rollout : log.rollouts) {
    for (Transition& t : rollout.transitions) {
      t.q(0) = random.Uniform(-3, 3), t.v(0) = random.Uniform(-5, 5);
      t.next_q(0) = random.Uniform(-3, 3), t.next_v(0) = random.Uniform(-5, 5);
    }
  }
  const Findings f = Of({log});
  CAPTURE(f.holdout.summary);
  CHECK((f.misspecification.alarm || !f.holdout.better));
  CHECK(f.holdout.errors[0].posterior == Approx(f.holdout.errors[0].prior).epsilon(0.03));
  // of a uniform reading, or of two
  CHECK(f.noise_sd(0) == Approx(6 / std::sqrt(12)).epsilon(0.5));
}

TEST_CASE("an unknown method is an error that names the nearest") {
  const std::vector<Log> logs{Swinging("a", kSwingingTruth, 1, 0)};
  CHECK_THROWS_WITH(Of(logs, "laplas"),
                    Catch::Contains("'laplas'") && Catch::Contains("'laplace'"));
  CHECK_THROWS_AS(Of(logs, "laplas"), std::invalid_argument);
}

TEST_CASE("what is no data, or hardly any, is refused or believed as little as it deserves") {
  CHECK_THROWS_AS(Of({}), std::invalid_argument);
  CHECK_THROWS_AS(Of({Log{}}), std::invalid_argument);
  SECTION("one transition") {
    CHECK_THROWS_WITH(Of({Swinging("a", kSwingingTruth, 1, 0, 1)}), Catch::Contains("too few"));
  }
  SECTION("one transition whose noise is known") {
    Log log = Swinging("a", kSwingingTruth, 1, 0, 1);
    for (Transition& t : log.rollouts[0].transitions) {
      t.q_sd = t.next_q_sd = Eigen::VectorXd::Constant(1, 1e-3);
      t.v_sd = t.next_v_sd = Eigen::VectorXd::Constant(1, 5e-3);
    }
    const Findings f = Of({log});
    CHECK_FALSE(f.holdout.better);
    const Gaussian posterior = Moments(f.posterior);
    CHECK((posterior.covariance.diagonal().array() <= 1.001 * f.prior.covariance.diagonal().array())
              .all());
    CHECK(((posterior.mean - Eigen::Vector3d(kSwingingTruth.array().log())).array().abs() <
           4 * posterior.covariance.diagonal().array().sqrt())
              .all());
    CHECK(f.noise_sd(0) == Approx(1e-3).epsilon(0.3));
  }
  SECTION("a pendulum at rest tells nothing but that it hangs") {
    Log log = Swinging("rest", kSwingingTruth, 2, 0);
    for (Rollout& rollout : log.rollouts) {
      for (Transition& t : rollout.transitions) {
        for (Eigen::VectorXd* x : {&t.q, &t.v, &t.next_q, &t.next_v}) x->setConstant(0);
        // hanging is an equilibrium of all pendulums, at whichever end it is
        t.q(0) = t.next_q(0) = M_PI;
        for (EffortSegment& e : t.efforts) e.effort.setZero();
      }
    }
    const Findings f = Of({log});
    CHECK_FALSE(f.holdout.better);
    const Gaussian posterior = Moments(f.posterior);
    CHECK(posterior.mean.allFinite());
    CHECK(posterior.covariance.allFinite());
  }
}

TEST_CASE("noise that the record knows is what is reported") {
  Log log;
  log.name = "known";
  for (uint32_t i = 0; i < 5; ++i)
    log.rollouts.push_back(SyntheticRollout(Pendulum(), kSwingingTruth, 40, 2e-3, 8e-3, 70 + i));
  for (const char* method : {"laplace", "reps"}) {
    const Findings f = Of({log}, method, 400'000);
    CAPTURE(method);
    CHECK(f.noise_sd(0) == Approx(2e-3).epsilon(0.25));
    CHECK(f.noise_sd(1) == Approx(8e-3).epsilon(0.25));
    CHECK(f.discrepancy == Approx(1).epsilon(0.3));
    CHECK_FALSE(f.misspecification.alarm);
  }
  // What the model does not explain shows, however large the scale of the errors is estimated.
  for (Rollout& rollout : log.rollouts) {
    for (Transition& t : rollout.transitions) t.next_v.array() += 0.1 * std::sin(3.0 * t.step);
  }
  CHECK(Of({log}, "laplace").discrepancy > 20);
  CHECK(std::isnan(Of({Swinging("nobody says", kSwingingTruth, 3, 0)}, "laplace").discrepancy));
}

TEST_CASE("each method runs and comes near") {
  const std::vector<Log> logs{Swinging("a", kSwingingTruth, 2, 80, 30)};
  const Findings laplace = Of(logs, "laplace");
  const Eigen::Vector3d heavy(0, 1, 2);
  const double truth = heavy.dot(Eigen::Vector3d(kSwingingTruth.array().log()));
  for (const std::string& method : CalibrationMethods()) {
    CAPTURE(method);
    const Findings f = Of(logs, method, 100'000);
    CHECK(f.method == method);
    CHECK((f.used == method || method == "auto"));
    CHECK(f.samples.rows() == 3);
    CHECK(f.samples.cols() > 0);
    CHECK(f.samples.allFinite());
    const bool approximate = method.starts_with("abc") || method == "conditional-mixture";
    CHECK(f.simulated_steps <= 100'000 + (approximate ? laplace.simulated_steps : 0));
    CHECK(f.errors.size() == 120);
    CHECK(f.errors.allFinite());
    CHECK(std::isnan(f.discrepancy));  // nobody says what the noise is
    CHECK(heavy.dot(Moments(f.posterior).mean) ==
          Approx(truth).margin(method == "simopt" ? 0.2 : 0.05));
    CHECK(f.holdout.better);
  }
}

TEST_CASE("the same bits with any number of threads and a journal or none") {
  const std::vector<Log> logs{Swinging("a", kSwingingTruth, 2, 90, 30)};
  for (const char* method : {"auto", "mixture", "reps", "simopt"}) {
    CalibrationOptions options;
    options.method = method, options.budget = 20'000, options.horizons = {1, 5};
    const Findings one = Calibrate(Pendulum(), logs, options);
    options.execution = 2;
    const Findings two = Calibrate(Pendulum(), logs, options);
    CHECK(one.samples == two.samples);
    CHECK(one.errors == two.errors);
    CHECK(one.simulated_steps == two.simulated_steps);
  }
}

TEST_CASE("simulations that fail over a part of the prior do not spoil the rest") {
  // Masses so uncertain that some of them are none at all, where the coordinate is the mass itself.
  RobotDescription robot = Pendulum();
  robot.parameters[1].coordinate = ParameterDescription::Coordinate::kLinear;
  robot.parameters[1].variance = 4;
  const std::vector<Log> logs{Swinging("a", kSwingingTruth, 4, 95)};
  for (const char* method : {"laplace", "reps"}) {
    CAPTURE(method);
    CalibrationOptions options;
    options.method = method, options.horizons = {1, 5};
    const Findings f = Calibrate(robot, logs, options);
    CHECK(f.holdout.better);
    if (options.method == "reps") CHECK(f.failures > 0);
  }
}

TEST_CASE("hold-out keeps every fifth roll-out back, or the last fifth of each") {
  const Log five = Swinging("a", kSwingingTruth, 11, 0, 7);
  const Split whole = HoldOut(five.rollouts);
  REQUIRE(whole.held_out.size() == 2);
  CHECK(whole.held_out[0].episode == 4);
  CHECK(whole.held_out[1].episode == 9);
  CHECK(whole.fitted.size() == 9);
  const Log few = Swinging("a", kSwingingTruth, 4, 0, 13);
  const Split parts = HoldOut(few.rollouts);
  REQUIRE(parts.held_out.size() == 4);
  for (const Rollout& rollout : parts.held_out) {
    REQUIRE(rollout.transitions.size() == 2);
    CHECK(rollout.transitions[0].step == 11);
  }
  for (const Rollout& rollout : parts.fitted) CHECK(rollout.transitions.size() == 11);
  const Log hardly = Swinging("a", kSwingingTruth, 1, 0, 9);
  CHECK(HoldOut(hardly.rollouts).held_out.empty());
  CHECK(HoldOut(hardly.rollouts).fitted.size() == 1);
}

}  // namespace
}  // namespace plumb
