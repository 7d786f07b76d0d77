#include "calibrator/fit/streaming.h"
#include "calibrator/fit/robot_least_squares.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "common/decompositions.h"
#include "common/special_numbers.h"
#include "robot/parameter_distribution.h"
#include "tests/calibrator/hopper.h"
#include "tests/calibrator/synthetic.h"

namespace plumb {
namespace {

// FitLaplace of windows of one step, as exactly as it can: again from its own mode until slopes are
// those at the mode.
LaplaceFit Batch(const RobotDescription& robot, const std::vector<Rollout>& rollouts,
                 const Eigen::VectorXd& noise_sd) {
  WindowErrors errors(std::make_shared<Model>(robot), rollouts, 1, 1);
  errors.set_noise_sd(noise_sd);
  LaplaceOptions options;
  options.robust = options.sandwich = false;
  options.tolerance = 1e-9;
  LaplaceFit fit;
  fit.mode = PriorOf(robot).FromStandard(Eigen::VectorXd::Zero(errors.parameter_count()));
  for (int round = 0; round < 6; ++round) {
    errors.Linearise(robot.ToPhysical(fit.mode));
    fit = FitLaplace(ProblemOf(robot, errors), fit.mode, options);
  }
  return fit;
}

StreamingLaplace Stream(const RobotDescription& robot, const std::vector<Rollout>& rollouts) {
  StreamingLaplace stream(std::make_shared<Model>(robot));
  for (const Rollout& rollout : rollouts) {
    for (const Transition& t : rollout.transitions) stream.Add(t, rollout.episode);
  }
  return stream;
}

// @param unknown tolerance of the mean along directions that only the prior tells of, [sd]: a
// forward difference is a small force there.
void CheckEqual(const StreamingLaplace& stream, const LaplaceFit& batch, double tolerance,
                double unknown = 1e-6) {
  const Gaussian found = stream.standard();
  INFO("means\n" << found.mean.transpose() << "\n" << batch.standard.mean.transpose());
  const Eigen::VectorXd offset = found.mean - batch.standard.mean;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(batch.standard.covariance);
  for (Eigen::Index i = 0; i < offset.size(); ++i) {
    CHECK(std::abs(axes.eigenvectors().col(i).dot(offset)) <
          (axes.eigenvalues()(i) > 0.5 ? unknown : tolerance));
  }
  const Eigen::ArrayXd sd = found.covariance.diagonal().cwiseSqrt(),
                       expected = batch.standard.covariance.diagonal().cwiseSqrt();
  INFO("sds\n" << sd.transpose() << "\n" << expected.transpose());
  CHECK((sd / expected - 1).abs().maxCoeff() < tolerance);
  CHECK((found.covariance - batch.standard.covariance).cwiseAbs().maxCoeff() <
        tolerance * batch.standard.covariance.cwiseAbs().maxCoeff());
  CHECK((stream.scale().array() / batch.scale.array() - 1).abs().maxCoeff() < tolerance);
}

TEST_CASE("a streamed log of the hopper gives the batch's answer") {
  const RobotDescription robot = Hopper();
  const Eigen::VectorXd truth = RandomMasses(robot, 1);
  const std::vector<Rollout> rollouts = RandomRollouts(robot, truth, 1000, 1e-4, 1);
  StreamingLaplace stream = Stream(robot, rollouts);
  const LaplaceFit batch = Batch(robot, rollouts, stream.noise_sd());
  CHECK(stream.transitions() == 1000);
  CHECK(stream.left_out() == 0);
  SECTION("nearly at once") {
    const Gaussian found = stream.standard();
    CHECK(((found.mean - batch.standard.mean).array() /
           batch.standard.covariance.diagonal().array().sqrt())
              .abs()
              .maxCoeff() < 0.02);
    CHECK((found.covariance.diagonal().array() / batch.standard.covariance.diagonal().array() - 1)
              .abs()
              .maxCoeff() < 0.02);
  }
  REQUIRE(stream.Settle());
  CheckEqual(stream, batch, 1e-6);
  CHECK((stream.posterior().mean - batch.posterior.mean).cwiseAbs().maxCoeff() < 1e-6);
}

TEST_CASE("where noise is all the truth leaves, or none, the stream finds the truth") {
  const RobotDescription robot = Hopper();
  const Eigen::VectorXd truth = RandomMasses(robot, 2);
  StreamingLaplace stream = Stream(robot, RandomRollouts(robot, truth, 100, 0, 2));
  REQUIRE(stream.Settle());
  CHECK((robot.ToPhysical(stream.posterior().mean) - truth).cwiseAbs().maxCoeff() < 1e-6);
}

TEST_CASE(
    "uncertain starts, entries that nobody saw and noise that nobody knows are treated as the "
    "batch does") {
  const RobotDescription robot = Pendulum();
  const Eigen::Vector3d truth(9.3, 0.93, 1.07);
  std::vector<Rollout> rollouts;
  for (uint32_t i = 0; i < 3; ++i)
    rollouts.push_back(SyntheticRollout(robot, truth, 100, 1e-4, 0.01, i));
  const auto for_all = [&](const auto& change) {
    for (Rollout& rollout : rollouts) {
      for (Transition& t : rollout.transitions) change(t);
    }
  };
  SECTION("both ends known") {}
  SECTION("some positions unseen") {
    for_all([](Transition& t) {
      if (t.step % 3 == 1) t.next_q(0) = kNaN;
    });
  }
  SECTION("noise unknown, of both ends") {
    for_all([](Transition& t) { t.q_sd(0) = t.v_sd(0) = t.next_q_sd(0) = t.next_v_sd(0) = kNaN; });
  }
  SECTION("noise unknown, starts exact") {
    for_all(
        [](Transition& t) { t.q_sd(0) = t.v_sd(0) = 0, t.next_q_sd(0) = t.next_v_sd(0) = kNaN; });
  }
  SECTION("few rows share one scale") {
    rollouts.resize(1);
    rollouts[0].transitions.resize(15);
    for_all([](Transition& t) { t.next_q_sd(0) = t.next_v_sd(0) = kNaN; });
  }
  StreamingLaplace stream = Stream(robot, rollouts);
  REQUIRE(stream.Settle());
  // Of few rows the batch's cost, which takes no account of parameters, refuses the last bit of its
  // own steps.
  CheckEqual(stream, Batch(robot, rollouts, stream.noise_sd()), rollouts.size() == 1 ? 1e-3 : 1e-5,
             2e-3);
  if (rollouts.size() > 1) {
    // (ln g, ln m, ln l) along (1, -2, 1) cannot be told: as wide as the prior there.
    const Gaussian found = stream.posterior();
    const Eigen::Vector3d null = Eigen::Vector3d(1, -2, 1).normalized();
    const Eigen::Vector3d precision = PriorGaussian(robot).covariance.diagonal().cwiseInverse();
    CHECK(null.dot(Inverse(found.covariance) * null) ==
          Approx(null.dot(precision.asDiagonal() * null)).epsilon(1e-3));
  }
}

TEST_CASE("the same transitions give the same bits, and too few the prior") {
  const RobotDescription robot = Pendulum();
  const std::vector<Rollout> rollouts{
      SyntheticRollout(robot, Eigen::Vector3d(9.3, 0.93, 1.07), 50, 1e-4, 0.01, 1)};
  const Gaussian a = Stream(robot, rollouts).standard(), b = Stream(robot, rollouts).standard();
  CHECK(a.mean == b.mean);
  CHECK(a.covariance == b.covariance);
  StreamingLaplace few(std::make_shared<Model>(robot));
  CHECK(few.Settle());
  CHECK_FALSE(few.determined());
  Transition unknown = rollouts[0].transitions[0];
  unknown.next_q_sd(0) = unknown.next_v_sd(0) = kNaN;
  CHECK(few.Add(unknown));
  CHECK_FALSE(few.determined());
  CHECK(few.standard().mean.isZero(0));
  CHECK(few.standard().covariance.isIdentity(0));
}

TEST_CASE(
    "a transition that cannot be simulated is counted and left out; one that is no window is "
    "refused") {
  const RobotDescription robot = Pendulum();
  std::vector<Rollout> rollouts{
      SyntheticRollout(robot, Eigen::Vector3d(9.3, 0.93, 1.07), 60, 1e-4, 0.01, 1)};
  const LaplaceFit batch = Batch(robot, rollouts, GuessedNoise(robot));
  StreamingLaplace stream(std::make_shared<Model>(robot));
  int64_t accepted = 0;
  for (const Transition& t : rollouts[0].transitions) {
    accepted += stream.Add(t);
    if (t.step == 20) {
      Transition wild = t;
      wild.v(0) = 1e8;  // beyond what counts as simulated
      CHECK_FALSE(stream.Add(wild));
      Transition unseen = t;
      unseen.next_q(0) = unseen.next_v(0) = kNaN;
      CHECK_FALSE(stream.Add(unseen));
      Transition broken = t;
      broken.efforts.clear();
      CHECK_THROWS_AS(stream.Add(broken), std::invalid_argument);
    }
  }
  CHECK(accepted == 60);
  CHECK(stream.transitions() == 62);
  CHECK(stream.left_out() == 2);
  REQUIRE(stream.Settle());
  CHECK(stream.left_out() == 2);
  CheckEqual(stream, batch, 1e-4, 2e-3);
}

}  // namespace
}  // namespace plumb
