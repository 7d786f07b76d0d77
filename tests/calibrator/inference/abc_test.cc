#include <catch2/catch.hpp>

#include "calibrator/inference/abc_rejection.h"
#include "calibrator/inference/abc_smc.h"
#include "calibrator/inference/regression_adjustment.h"
#include "tests/calibrator/inference/linear_problem.h"

namespace plumb {
namespace {

// The posterior of LinearProblem(), by its moments.
void CheckPosterior(const Posterior& posterior, double mean_margin, double variance_margin) {
  for (const Gaussian& moments : {SampleMoments(posterior.samples), Moments(posterior.mixture)}) {
    CHECK((moments.mean - Eigen::Vector2d(0.64, -0.32)).norm() < mean_margin);
    CHECK((moments.covariance - 0.2 * Eigen::Matrix2d::Identity()).norm() < variance_margin);
  }
}

TEST_CASE("rejection finds a linear problem's posterior, and better with regression than without") {
  RejectionOptions options;
  options.simulations = 20'000;
  options.fraction = 0.05;
  options.samples = 4'000;
  RejectionDiagnostics report;
  const Posterior adjusted = InferByRejection(LinearProblem(), options, 1, &report);
  CheckPosterior(adjusted, 0.06, 0.06);
  CHECK(report.kept == 1'000);
  options.adjust = false;
  options.fraction = 0.4;
  const Posterior plain = InferByRejection(LinearProblem(), options, 1);
  CHECK(SampleMoments(plain.samples).covariance(0, 0) > 0.3);
  options.adjust = true;
  CHECK(SampleMoments(InferByRejection(LinearProblem(), options, 1).samples).covariance(0, 0) <
        0.25);
}

TEST_CASE("a few accepted simulations tell no covariance: the prior stays") {
  RejectionOptions options;
  options.simulations = 40, options.fraction = 0.05;  // two
  const Gaussian found = Moments(InferByRejection(LinearProblem(), options, 1).mixture);
  const Eigen::VectorXd width = LinearProblem().prior.Width();
  for (Eigen::Index i = 0; i < width.size(); ++i)
    CHECK(std::sqrt(found.covariance(i, i)) == Approx(width(i)).epsilon(0.1));
}

TEST_CASE("SMC finds a linear problem's posterior") {
  SmcOptions options;
  options.samples = 4'000;
  SmcDiagnostics report;
  const Posterior posterior = InferBySmc(LinearProblem(), options, 1, &report);
  CheckPosterior(posterior, 0.1, 0.09);
  REQUIRE(report.generations.size() > 3);
  // Epsilon is in units of scales that shrink, too, as the simulations gather around the
  // observation.
  CHECK(report.generations.back().epsilon < 0.7 * report.generations[1].epsilon);
  CHECK(report.generations.back().effective > 100);
  CHECK(posterior.simulations <= options.simulations);
}

TEST_CASE("SMC without adjustment weights its population against the prior") {
  // Without the weights, a few generations at a loose epsilon would tend to the likelihood, of mean
  // 0.8, not 0.64.
  SmcOptions options;
  options.adjust = false;
  options.samples = 4'000;
  options.population = 1'000;
  options.simulations = 15'000;
  const Posterior posterior = InferBySmc(LinearProblem(), options, 2);
  CHECK((SampleMoments(posterior.samples).mean - Eigen::Vector2d(0.64, -0.32)).norm() < 0.07);
}

TEST_CASE("failures are counted and never accepted; batches change nothing") {
  const Problem problem = LinearProblem(0.);
  RejectionOptions options;
  options.simulations = 4'000;
  options.samples = 500;
  options.adjust = false;
  const Posterior posterior = InferByRejection(problem, options, 3);
  CHECK(posterior.failures == Approx(2'000).margin(150));
  CHECK(SampleMoments(posterior.samples).mean(1) < -0.2);
  options.batch = 77;
  CHECK(InferByRejection(problem, options, 3).samples == posterior.samples);
  options.batch = 1'000;
  CHECK(InferByRejection(problem, options, 4).samples != posterior.samples);

  SmcOptions smc;
  smc.simulations = 3'000;
  smc.samples = 500;
  CHECK(InferBySmc(problem, smc, 3).failures > 400);
  CHECK(InferBySmc(problem, smc, 3).samples == InferBySmc(problem, smc, 3).samples);
}

TEST_CASE("if everything fails the posterior is the prior, and everything is counted") {
  const Problem problem = LinearProblem(-1e9);
  const Posterior rejection = InferByRejection(problem, {}, 1), smc = InferBySmc(problem, {}, 1);
  for (const Posterior& posterior : {rejection, smc}) {
    CHECK(posterior.failures == posterior.simulations);
    CHECK((SampleMoments(posterior.samples).covariance - Eigen::Matrix2d::Identity()).norm() <
          0.08);
  }
}

TEST_CASE("what makes no sense is refused") {
  Problem problem = LinearProblem();
  RejectionOptions options;
  options.distance = "manhattan";
  CHECK_THROWS_WITH(InferByRejection(problem, options, 1), Catch::Contains("mahalanobis"));
  problem.observed.setConstant(std::numeric_limits<double>::quiet_NaN());
  CHECK_THROWS_AS(InferByRejection(problem, {}, 1), std::invalid_argument);
  CHECK_THROWS_AS(InferBySmc(problem, {}, 1), std::invalid_argument);
}

TEST_CASE(
    "regression adjustment of an exactly linear relation is exact, and rescales growing noise") {
  Random random(9);
  const Eigen::MatrixXd s = StandardNormals(2, 2'000, random);
  const Eigen::Vector2d observed(0.3, -0.2);
  const Eigen::VectorXd distances = (s.colwise() - observed).colwise().norm(),
                        equal = Eigen::VectorXd::Ones(2'000);
  Eigen::MatrixXd u = (2 * s.row(0) - s.row(1)).array() + 1;
  const AdjustedSamples exact = AdjustByRegression(u, s, observed, distances, equal);
  for (Eigen::Index i = 0; i < 2'000; ++i) {
    if (exact.weights(i) > 0)
      REQUIRE(exact.samples(0, i) == Approx(2 * 0.3 + 0.2 + 1).margin(1e-6));
  }
  CHECK(exact.weights.sum() == Approx(1));

  Eigen::VectorXd far = Eigen::VectorXd::Constant(2'000, std::numeric_limits<double>::infinity());
  CHECK_THROWS_AS(AdjustByRegression(u, s, observed, far, equal), std::invalid_argument);
  far.head(4).setConstant(1);
  CHECK(AdjustByRegression(u, s, observed, far, equal).samples == u);  // too few to regress
}

}  // namespace
}  // namespace plumb
