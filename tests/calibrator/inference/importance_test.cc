#include "calibrator/inference/importance.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <stdexcept>

#include "common/decompositions.h"
#include "common/special_numbers.h"

namespace plumb {
namespace {

// Two modes; ln of the density plus 700, which no method may care about.
const Eigen::Vector2d kLeft(-3, 0), kRight(2, 1);
Eigen::Matrix2d RightSpread() { return Eigen::Matrix2d{{0.5, 0.3}, {0.3, 0.4}}; }
double LeftDensity(const Eigen::Vector2d& x) {
  const Eigen::Vector2d z = (x - kLeft).cwiseQuotient(Eigen::Vector2d(0.5, 0.2));
  return std::exp(-0.5 * z.squaredNorm()) / (2 * M_PI * 0.5 * 0.2);
}
double RightDensity(const Eigen::Vector2d& x) {
  return std::exp(-0.5 * (x - kRight).dot(RightSpread().inverse() * (x - kRight))) /
         (2 * M_PI * std::sqrt(RightSpread().determinant()));
}
Eigen::VectorXd Bimodal(const Eigen::MatrixXd& points) {
  Eigen::VectorXd density(points.cols());
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    density(i) =
        std::log(0.3 * LeftDensity(points.col(i)) + 0.7 * RightDensity(points.col(i))) + 700;
  }
  return density;
}

GaussianMixture Guess(double left) {
  return {{left, 1 - left},
          {{Eigen::Vector2d(-2.5, 0.3), 0.3 * Eigen::Matrix2d::Identity()},
           {Eigen::Vector2d(2.4, 0.8), 0.2 * Eigen::Matrix2d::Identity()}}};
}

void CheckMoments(const ImportanceFit& fit) {
  const Eigen::Vector2d mean = 0.3 * kLeft + 0.7 * kRight;
  const Eigen::Vector2d off = kLeft - kRight;
  const Eigen::Matrix2d covariance =
      0.3 * Eigen::Matrix2d(Eigen::Vector2d(0.25, 0.04).asDiagonal()) + 0.7 * RightSpread() +
      0.21 * off * off.transpose();
  const Eigen::Vector2d weighted = fit.samples * fit.weights;
  const Eigen::MatrixXd centred = fit.samples.colwise() - weighted;
  CHECK((weighted - mean).norm() < 0.15);
  CHECK((centred * fit.weights.asDiagonal() * centred.transpose() - covariance).norm() <
        0.06 * covariance.norm());
  const Gaussian adapted = Moments(fit.mixture);
  CHECK((adapted.mean - mean).norm() < 0.15);
  CHECK((adapted.covariance - covariance).norm() < 0.08 * covariance.norm());
}

TEST_CASE("a guess of which one sample counts is not taken for ever surer") {
  // Far narrower than the guess, and outside of it: nearest is all that a sample can be.
  const auto needle = [](const Eigen::MatrixXd& points) -> Eigen::VectorXd {
    return -0.5e8 * (points.array() - 40).square().transpose();
  };
  const Gaussian guess{Eigen::VectorXd::Zero(1), Eigen::MatrixXd::Identity(1, 1)};
  const ImportanceFit fit = FitByImportance(needle, {{1}, {guess}}, {.samples = 50});
  CHECK(fit.ess < 1.1);
  CHECK(fit.power < 1);
  CHECK(fit.mixture.components[0].mean(0) > 1);
  CHECK(fit.mixture.components[0].covariance(0, 0) >= 1);
}

TEST_CASE("of a rough density no single peak is taken for the whole") {
  // A standard normal's logarithm under ripples of 6000 from valley to peak, 0.006 apart, no two
  // alike.
  const auto rough = [](const Eigen::MatrixXd& points) -> Eigen::VectorXd {
    const auto x = points.array();
    return (-0.5 * x.square() + 1500 * ((1000 * x).sin() + (1732 * x).sin())).transpose();
  };
  const Gaussian guess{Eigen::VectorXd::Constant(1, 0.8), Eigen::MatrixXd::Constant(1, 1, 1e-4)};
  const ImportanceFit fit = FitByImportance(rough, {{1}, {guess}}, {.samples = 200});
  CHECK(fit.ess < 10);
  CHECK(fit.power < 1);
  CHECK(1 / fit.weights.squaredNorm() == Approx(10).epsilon(0.02));
  CHECK(fit.samples.cols() == 1600);
  const Gaussian found = Moments(fit.mixture);
  CHECK(found.covariance(0, 0) > 1e-2);  // ten times the guess's width
  CHECK(std::abs(found.mean(0)) < 2);
}

// The largest variance in any direction.
double Widest(const ImportanceFit& fit) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(Moments(fit.mixture).covariance)
      .eigenvalues()
      .maxCoeff();
}

TEST_CASE("of a rough density nothing is learnt that is wider than the prior") {
  // Peaks that are hardly wider than their distances are many, all over a prior that is N(0, 1).
  const auto comb = [](const Eigen::MatrixXd& x) -> Eigen::VectorXd {
    const Eigen::ArrayXXd at = x.array();
    return -0.5 * at.square().colwise().sum().transpose() +
           4e3 * ((37 * at.row(0)).cos() + (53 * at.row(1)).cos()).transpose();
  };
  const Gaussian guess{Eigen::Vector2d(1.5, -1), 0.3 * Eigen::Matrix2d::Identity()};
  ImportanceOptions options;
  options.samples = 100;
  options.widest = Eigen::Matrix2d::Identity();
  const ImportanceFit bounded = FitByImportance(comb, {{1}, {guess}}, options);
  CHECK(bounded.power < 1);
  CHECK(Widest(bounded) < 1 + 1e-9);
  options.widest.resize(0, 0);
  CHECK(Widest(FitByImportance(comb, {{1}, {guess}}, options)) > 3);
}

TEST_CASE("two modes get the weights, the places and the widths that they have") {
  const ImportanceFit fit = FitByImportance(Bimodal, Guess(0.5));
  CHECK(fit.samples.cols() == 1600);
  CHECK(fit.weights.sum() == Approx(1));
  CHECK(fit.weights.minCoeff() >= 0);
  CHECK(fit.ess == Approx(1 / fit.weights.squaredNorm()));
  CHECK(fit.heaviest == fit.weights.maxCoeff());
  CHECK(fit.ess > 600);
  CHECK(fit.heaviest < 0.005);
  CheckMoments(fit);
  REQUIRE(fit.mixture.components.size() == 2);
  CHECK(fit.mixture.weights[0] == Approx(0.3).margin(0.03));
  CHECK((fit.mixture.components[0].mean - kLeft).norm() < 0.1);
  CHECK((fit.mixture.components[1].mean - kRight).norm() < 0.1);
  CHECK((fit.mixture.components[1].covariance - RightSpread()).norm() < 0.1);
  // Weights are target / mixture of all proposals: for a sample's neighbourhood, E[w] is its
  // probability.
  double left = 0;
  for (Eigen::Index i = 0; i < 1600; ++i) left += fit.samples(0, i) < -0.5 ? fit.weights(i) : 0;
  CHECK(left == Approx(0.3).margin(0.03));
  // The same bits again, others with another seed.
  CHECK(FitByImportance(Bimodal, Guess(0.5)).weights == fit.weights);
  ImportanceOptions other;
  other.seed = 2;
  CHECK(FitByImportance(Bimodal, Guess(0.5), other).samples != fit.samples);
}

TEST_CASE("a mode that the guess thinks little of is found out") {
  const double left = GENERATE(0.98, 0.02, 0.005, 0.001);
  CAPTURE(left);
  const ImportanceFit fit = FitByImportance(Bimodal, Guess(left));
  REQUIRE(fit.mixture.components.size() == 2);
  CHECK(fit.mixture.weights[0] == Approx(0.3).margin(0.05));
  CheckMoments(fit);
  CHECK(fit.ess > 250);
}

TEST_CASE("a guess of one mode too many loses it") {
  GaussianMixture guess = Guess(0.5);
  guess.weights = {0.3, 0.3, 0.4};
  guess.components.push_back({Eigen::Vector2d(30, 30), 0.1 * Eigen::Matrix2d::Identity()});
  const ImportanceFit fit = FitByImportance(Bimodal, guess);
  CHECK(fit.mixture.components.size() == 2);
  CheckMoments(fit);
}

TEST_CASE("what is not finite has no density, and nothing anywhere is an error") {
  const Gaussian one{Eigen::VectorXd::Zero(1), Eigen::MatrixXd::Identity(1, 1)};
  // A standard normal's positive half; +infinity, too, is a failure, not a certainty.
  const ImportanceFit fit = FitByImportance(
      [&](const Eigen::MatrixXd& x) {
        Eigen::VectorXd density = -0.5 * x.row(0).transpose().array().square();
        for (Eigen::Index i = 0; i < x.cols(); ++i) {
          if (x(0, i) < 0) density(i) = i % 3 == 0 ? kNaN : i % 3 == 1 ? kInfinity : -kInfinity;
        }
        return density;
      },
      {{1}, {one}});
  CHECK(fit.samples.row(0).dot(fit.weights) == Approx(std::sqrt(2 / M_PI)).margin(0.05));
  for (Eigen::Index i = 0; i < fit.weights.size(); ++i) {
    if (fit.samples(0, i) < 0) REQUIRE(fit.weights(i) == 0);
  }
  for (const double nothing : {kNaN, -kInfinity}) {
    const auto impossible = [&](const Eigen::MatrixXd& x) -> Eigen::VectorXd {
      return Eigen::VectorXd::Constant(x.cols(), nothing);
    };
    CHECK_THROWS_AS(FitByImportance(impossible, {{1}, {one}}), std::invalid_argument);
  }
}

TEST_CASE("resampling takes each point as often as its weight says, up to one") {
  const Eigen::VectorXd weights = Eigen::VectorXd{{0.05, 0, 0.4, 0.15, 0.3, 0.1}};
  const Eigen::MatrixXd samples = Eigen::RowVectorXd::LinSpaced(6, 0, 5);
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(6);
  Random random(3);
  constexpr int kTrials = 2000, kCount = 17;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Eigen::MatrixXd drawn = Resample(samples, weights, kCount, random);
    REQUIRE(drawn.cols() == kCount);
    for (int i = 0; i < 6; ++i) {
      const auto times = static_cast<double>((drawn.array() == i).count());
      REQUIRE(std::abs(times - kCount * weights(i)) < 1);
      mean(i) += times / kTrials;
    }
  }
  CHECK((mean - kCount * weights).cwiseAbs().maxCoeff() < 0.05);  // unbiased
}

}  // namespace
}  // namespace plumb
