#include "common/gaussian.h"

#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>

namespace plumb {
namespace {

Gaussian Correlated() {
  Eigen::MatrixXd covariance(2, 2);
  covariance << 2, 0.5, 0.5, 1;
  return {Eigen::Vector2d(1, -2), covariance};
}

TEST_CASE("Kullback-Leibler divergence and density against a sum over a fine grid") {
  const Gaussian p = Correlated();
  Gaussian q{Eigen::Vector2d(0.5, -1), 1.5 * Eigen::Matrix2d::Identity()};
  double kl = 0, mass = 0;
  const double h = 0.02;
  for (double x = -9; x < 11; x += h) {
    for (double y = -11; y < 8; y += h) {
      const Eigen::Vector2d at(x, y);
      const double log_p = LogDensity(p, at);
      mass += std::exp(log_p) * h * h;
      kl += std::exp(log_p) * (log_p - LogDensity(q, at)) * h * h;
    }
  }
  CHECK(mass == Approx(1).epsilon(1e-6));
  CHECK(KlDivergence(p, q) == Approx(kl).epsilon(1e-4));
  CHECK(KlDivergence(p, p) == Approx(0).margin(1e-12));
}

TEST_CASE("the divergence of one normal distribution from another, in closed form") {
  const Gaussian p{Eigen::VectorXd::Constant(1, 3), Eigen::MatrixXd::Constant(1, 1, 0.25)},
      q{Eigen::VectorXd::Constant(1, 1), Eigen::MatrixXd::Constant(1, 1, 4)};
  // ln(s_q / s_p) + (s_p^2 + d^2) / (2 s_q^2) - 1/2
  CHECK(KlDivergence(p, q) == Approx(std::log(4) + 4.25 / 8 - 0.5));
  CHECK(KlDivergence(q, p) == Approx(-std::log(4) + (4 + 4.) / 0.5 - 0.5));
}

TEST_CASE("the standard normal distribution, to the tails (Abramowitz and Stegun, table 26.1)") {
  CHECK(NormalCdf(0) == 0.5);
  CHECK(NormalCdf(1) == Approx(0.841344746068543).epsilon(1e-14));
  CHECK(NormalCdf(-2) == Approx(0.0227501319481792).epsilon(1e-14));
  CHECK(NormalCdf(-10) == Approx(7.61985302416053e-24).epsilon(1e-13).margin(0));
}

TEST_CASE("a precision is the covariance's inverse, and normals become the distribution's") {
  const Gaussian p = Correlated();
  CHECK((Precision(p) * p.covariance).isIdentity(1e-12));
  Random random(11);
  const Eigen::MatrixXd samples = Transform(p, StandardNormals(2, 20000, random));
  const Eigen::MatrixXd centred = samples.colwise() - samples.rowwise().mean();
  CHECK((samples.rowwise().mean() - p.mean).norm() < 0.03);
  CHECK((centred * centred.transpose() / 20000 - p.covariance).norm() < 0.06);
}

TEST_CASE("a mixture's moments, and draws from its components in proportion") {
  const Gaussian one{Eigen::VectorXd::Constant(1, -1), Eigen::MatrixXd::Constant(1, 1, 0.5)},
      other{Eigen::VectorXd::Constant(1, 3), Eigen::MatrixXd::Constant(1, 1, 2)};
  const GaussianMixture mixture{{0.75, 0.25}, {one, other}};
  const Gaussian moments = Moments(mixture);
  CHECK(moments.mean(0) == Approx(0));
  // within the components, and between them
  CHECK(moments.covariance(0, 0) == Approx(0.75 * (0.5 + 1) + 0.25 * (2 + 9)));
  Random random(12);
  int first = 0;
  double sum = 0;
  constexpr int kDraws = 20000;
  for (int i = 0; i < kDraws; ++i) {
    first += SampleComponent(mixture, random) == 0;
    sum += Sample(mixture, random)(0);
  }
  CHECK(first == Approx(0.75 * kDraws).epsilon(0.02));
  CHECK(sum / kDraws == Approx(0).margin(0.06));
}

}  // namespace
}  // namespace plumb
