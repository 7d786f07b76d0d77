#include "calibrator/inference/conditional_mixture.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "calibrator/inference/truncated_prior.h"
#include "tests/calibrator/inference/linear_problem.h"

namespace plumb {
namespace {

ConditionalMixtureOptions Few(int64_t simulations) {
  ConditionalMixtureOptions options;
  options.simulations = simulations;
  options.samples = 4'000;
  options.rounds = 4;
  return options;
}

TEST_CASE("the mixture finds a linear problem's posterior") {
  ConditionalMixtureDiagnostics report;
  const Posterior posterior = InferConditionalMixture(LinearProblem(), Few(3'000), 1, &report);
  for (const Gaussian& moments : {SampleMoments(posterior.samples), Moments(posterior.mixture)}) {
    CHECK((moments.mean - Eigen::Vector2d(0.64, -0.32)).norm() < 0.06);
    CHECK((moments.covariance - 0.2 * Eigen::Matrix2d::Identity()).norm() < 0.04);
  }
  CHECK(posterior.simulations == 3'000);
  CHECK(report.rounds.size() == 3);
  // ln p(t | x) of the exact posterior is on average -1 - ln(2 pi 0.2): no estimate beats it but by
  // chance.
  CHECK(*std::max_element(report.held_out.begin(), report.held_out.end()) ==
        Approx(-1 - std::log(2 * M_PI * 0.2)).margin(0.15));
}

// x = |t1 + t2| / sqrt 2 + noise, (t2 - t1) / sqrt 2 + noise: two modes, each normal, as far from
// the bounds as need be.
TEST_CASE("both modes of a posterior are found, in equal parts and each of the right width") {
  const auto simulate = [](const Eigen::MatrixXd& t, int64_t first) {
    Eigen::MatrixXd x(2, t.cols());
    for (Eigen::Index j = 0; j < t.cols(); ++j) {
      Random random(5, {static_cast<uint32_t>(first + j)});
      x.col(j) << std::abs(t(0, j) + t(1, j)) * M_SQRT1_2, (t(1, j) - t(0, j)) * M_SQRT1_2;
      x.col(j) += 0.02 * StandardNormals(2, 1, random);
    }
    return x;
  };
  const Problem problem{Prior({Prior::Uniform(-1, 1), Prior::Uniform(-1, 1)}),
                        Eigen::Vector2d(0.5, 0.1), simulate};
  const Posterior posterior = InferConditionalMixture(problem, Few(4'000), 1);
  double above = 0, mean = 0, square = 0;
  for (const auto t : posterior.samples.colwise()) {
    const double sum = (t(0) + t(1)) * M_SQRT1_2;
    above += sum > 0;
    if (sum > 0) mean += sum, square += sum * sum;
  }
  CHECK(above / 4'000 == Approx(0.5).margin(0.06));
  mean /= above;
  CHECK(mean == Approx(0.5).margin(0.004));
  CHECK(std::sqrt(square / above - mean * mean) == Approx(0.02).epsilon(0.2));
}

TEST_CASE("the same bits for the same seed, however simulations are spread; failures are counted") {
  Problem problem = LinearProblem(1.);
  const Posterior posterior = InferConditionalMixture(problem, Few(1'500), 2);
  CHECK(posterior.failures > 50);
  CHECK(SampleMoments(posterior.samples).mean(1) == Approx(-0.32).margin(0.1));
  const Simulate whole = problem.simulate;
  problem.simulate = [whole](const Eigen::MatrixXd& t, int64_t first) {
    Eigen::MatrixXd x(3, t.cols());
    for (Eigen::Index j = t.cols() - 1; j >= 0; --j) x.col(j) = whole(t.col(j), first + j);
    return x;
  };
  CHECK(InferConditionalMixture(problem, Few(1'500), 2).samples == posterior.samples);
  CHECK(InferConditionalMixture(problem, Few(1'500), 3).samples != posterior.samples);
}

TEST_CASE(
    "without successes the posterior is the prior; a statistic that never varies is harmless") {
  const Posterior nothing = InferConditionalMixture(LinearProblem(-1e9), Few(500), 1);
  CHECK(nothing.failures == 500);
  CHECK((SampleMoments(nothing.samples).covariance - Eigen::Matrix2d::Identity()).norm() < 0.1);

  Problem problem = LinearProblem();
  problem.observed(2) = 7;
  const Simulate inner = problem.simulate;
  problem.simulate = [inner](const Eigen::MatrixXd& t, int64_t first) {
    Eigen::MatrixXd x = inner(t, first);
    x.row(2).setConstant(7);
    return x;
  };
  const Posterior posterior = InferConditionalMixture(problem, Few(1'500), 1);
  CHECK((SampleMoments(posterior.samples).mean - Eigen::Vector2d(0.64, -0.32)).norm() < 0.09);

  problem.observed.setConstant(std::nan(""));
  CHECK_THROWS_AS(InferConditionalMixture(problem, Few(500), 1), std::invalid_argument);
}

TEST_CASE("a truncated prior is the prior within its region, found either way") {
  // Two overlapping ellipsoids; far out, and small enough for the prior's own draws to miss them
  // nearly always.
  const double scale = GENERATE(1., 0.003);
  const Gaussian a{Eigen::Vector2d(1.5, 0), scale * 0.02 * Eigen::Matrix2d::Identity()};
  Gaussian b = a;
  b.mean(0) += 0.3 * std::sqrt(scale);
  const TruncatedPrior prior({{0.9, 0.1}, {a, b}}, 1e-2);
  // chi-squared of two: -2 ln 0.01
  const double reach = std::sqrt(scale * 0.02 * 2 * std::log(100));
  CHECK(prior.Contains(a.mean + Eigen::Vector2d(0, 0.999 * reach)));
  CHECK(!prior.Contains(a.mean + Eigen::Vector2d(0, 1.001 * reach)));
  Random random(1);
  const auto draws = prior.Sample(20'000, random);
  REQUIRE(draws);
  // The mean, and the share right of the middle, by a sum over a grid.
  double mass = 0, right = 0;
  Eigen::Vector2d mean(0, 0);
  const double middle = (a.mean(0) + b.mean(0)) / 2, h = reach / 200;
  for (double x = a.mean(0) - reach; x < b.mean(0) + reach; x += h) {
    for (double y = -reach; y < reach; y += h) {
      const Eigen::Vector2d u(x, y);
      if (!prior.Contains(u)) continue;
      const double p = std::exp(-0.5 * u.squaredNorm());
      mass += p, mean += p * u, right += x > middle ? p : 0;
    }
  }
  CHECK((draws->rowwise().mean() - mean / mass).norm() < 0.02 * reach);
  CHECK((draws->row(0).array() > middle).cast<double>().mean() ==
        Approx(right / mass).margin(0.012));
  // Nothing can be found where the prior has no density to speak of.
  const TruncatedPrior nowhere({{0.5, 0.5}, {a, {Eigen::Vector2d(0, 60), a.covariance}}}, 1e-2);
  CHECK_NOTHROW(nowhere.Sample(10, random));
  CHECK_THROWS_AS(TruncatedPrior({{}, {}}, 1e-2), std::invalid_argument);
}

}  // namespace
}  // namespace plumb
