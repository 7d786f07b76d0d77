#include "calibrator/inference/gaussian_mixture.h"

#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>

namespace plumb {
namespace {

// Two correlated components in (x, y).
GaussianMixture Example() {
  Eigen::Matrix2d a, b;
  a << 1, 0.8, 0.8, 1;
  b << 0.5, -0.3, -0.3, 0.4;
  return {{0.3, 0.7}, {{Eigen::Vector2d(-2, 1), a}, {Eigen::Vector2d(2, 0), b}}};
}

TEST_CASE("a mixture's density is the sum of its components', and integrates to one") {
  const GaussianMixture mixture = Example();
  double mass = 0;
  for (double x = -8; x < 8; x += 0.05) {
    for (double y = -5; y < 6; y += 0.05)
      mass += std::exp(LogDensity(mixture, Eigen::Vector2d(x, y))) * 0.05 * 0.05;
  }
  CHECK(mass == Approx(1).epsilon(1e-6));
  const Eigen::Vector2d at(0.5, 0.2);
  CHECK(std::exp(LogDensity(mixture, at)) ==
        Approx(0.3 * std::exp(LogDensity(mixture.components[0], at)) +
               0.7 * std::exp(LogDensity(mixture.components[1], at))));
}

TEST_CASE("conditioning and marginals agree with the joint density, by brute force") {
  const GaussianMixture joint = Example();
  const Eigen::VectorXd y = Eigen::VectorXd::Constant(1, 0.6);
  const GaussianMixture conditional = Condition(joint, y), marginal = Marginal(joint, {1});
  double mass = 0;
  for (double x = -10; x < 10; x += 0.001)
    mass += std::exp(LogDensity(joint, Eigen::Vector2d(x, 0.6))) * 0.001;
  CHECK(std::exp(LogDensity(marginal, y)) == Approx(mass).epsilon(1e-6));
  for (const double x : {-3., -1., 0., 1.7}) {
    const double expected = std::exp(LogDensity(joint, Eigen::Vector2d(x, 0.6))) / mass;
    CHECK(std::exp(LogDensity(conditional, Eigen::VectorXd::Constant(1, x))) ==
          Approx(expected).epsilon(1e-6));
  }
}

TEST_CASE("conditioning far from everything leaves the nearest component, finite") {
  const GaussianMixture conditional = Condition(Example(), Eigen::VectorXd::Constant(1, 1e6));
  CHECK(conditional.components.size() == 1);
  CHECK(std::isfinite(conditional.components[0].mean(0)));
  CHECK(conditional.weights[0] == 1);
}

TEST_CASE(
    "expectation maximisation never loses likelihood, and finds the mixture that made the "
    "samples") {
  Random random(3);
  const GaussianMixture truth = Example();
  const Eigen::MatrixXd samples = Sample(truth, 8'000, random);
  MixtureOptions options;
  options.regularisation = 0;
  const MixtureFit fit = FitMixture(samples, Eigen::VectorXd::Ones(8'000), 2, random, options);
  REQUIRE(fit.log_likelihood.size() > 2);
  for (size_t i = 1; i < fit.log_likelihood.size(); ++i) {
    CHECK(fit.log_likelihood[i] >= fit.log_likelihood[i - 1] - 1e-12);
  }
  const size_t left = fit.mixture.components[0].mean(0) < 0 ? 0 : 1;
  CHECK(fit.mixture.weights[left] == Approx(0.3).margin(0.02));
  CHECK((fit.mixture.components[left].mean - truth.components[0].mean).norm() < 0.08);
  CHECK((fit.mixture.components[left].covariance - truth.components[0].covariance).norm() < 0.15);
  CHECK((fit.mixture.components[1 - left].covariance - truth.components[1].covariance).norm() <
        0.06);
}

TEST_CASE("the number of components with the lowest BIC is the right one") {
  Random random(4);
  const Eigen::MatrixXd two = Sample(Example(), 3'000, random);
  CHECK(SelectMixture(two, Eigen::VectorXd::Ones(3'000), 16, random).mixture.components.size() ==
        2);
  const Eigen::MatrixXd one = StandardNormals(5, 1'000, random);
  CHECK(SelectMixture(one, Eigen::VectorXd::Ones(1'000), 16, random).mixture.components.size() ==
        1);
}

TEST_CASE("weights count as copies do") {
  Random random(5);
  const Eigen::MatrixXd samples = StandardNormals(2, 50, random);
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(50);
  weights.head(20).setConstant(3);
  weights.segment(20, 10).setConstant(1);
  const Gaussian fit = FitMixture(samples, weights, 1, random).mixture.components[0];
  const Eigen::VectorXd mean =
      (3 * samples.leftCols(20).rowwise().sum() + samples.middleCols(20, 10).rowwise().sum()) / 70;
  CHECK((fit.mean - mean).norm() < 1e-12);
}

TEST_CASE("degenerate samples still give a density; what is no sample is refused") {
  Random random(6);
  Eigen::MatrixXd flat = StandardNormals(2, 100, random);
  flat.row(1).setConstant(7);
  const MixtureFit fit = FitMixture(flat, Eigen::VectorXd::Ones(100), 3, random);
  CHECK(std::isfinite(LogDensity(fit.mixture, flat.col(0))));
  CHECK_NOTHROW(FitMixture(flat.leftCols(1), Eigen::VectorXd::Ones(1), 4, random));
  CHECK_THROWS_AS(FitMixture(flat, Eigen::VectorXd::Zero(100), 2, random), std::invalid_argument);
  CHECK_THROWS_AS(FitMixture(flat, Eigen::VectorXd::Ones(100), 0, random), std::invalid_argument);
  flat(0, 3) = std::nan("");
  CHECK_THROWS_AS(FitMixture(flat, Eigen::VectorXd::Ones(100), 2, random), std::invalid_argument);
}

}  // namespace
}  // namespace plumb
