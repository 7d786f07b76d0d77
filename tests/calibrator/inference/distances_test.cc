#include "calibrator/inference/distances.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "common/gaussian.h"

namespace plumb {
namespace {

Eigen::MatrixXd Normals(Eigen::Index rows, Eigen::Index count, uint64_t seed, double shift = 0) {
  Random random(seed);
  return StandardNormals(rows, count, random).array() + shift;
}

// E|Z| for Z ~ N(shift, sd^2), the folded normal's mean.
double MeanAbsolute(double shift, double sd) {
  const double z = shift / sd;
  return sd * std::sqrt(2 / M_PI) * std::exp(-z * z / 2) + shift * std::erf(z / std::sqrt(2));
}

TEST_CASE("energy distance of two normal distributions") {
  const double expected = 2 * MeanAbsolute(1.5, std::sqrt(2)) - 2 * MeanAbsolute(0, std::sqrt(2));
  CHECK(EnergyDistance(Normals(1, 2'000, 1), Normals(1, 1'500, 2, 1.5)) ==
        Approx(expected).epsilon(0.07));
  const Eigen::MatrixXd x = Normals(3, 40, 1);
  CHECK(EnergyDistance(x, x) == Approx(0).margin(1e-12));
}

TEST_CASE("MMD of two normal distributions, and its lack of bias") {
  // E k(X, Y) for a Gaussian kernel of bandwidth h and X - Y ~ N(d, 2): h / sqrt(h^2 + 2) exp(-d^2
  // / 2 (h^2 + 2)).
  double expected = 0;
  for (const double h : {0.25, 0.5, 1., 2., 4.}) {
    expected += 2 * h / std::sqrt(h * h + 2) * (1 - std::exp(-2.25 / (2 * (h * h + 2)))) / 5;
  }
  CHECK(MaximumMeanDiscrepancy(Normals(1, 1'500, 1), Normals(1, 1'500, 2, 1.5), 1) ==
        Approx(expected).epsilon(0.07));
  double mean = 0;
  for (uint64_t i = 0; i < 400; ++i)
    mean += MaximumMeanDiscrepancy(Normals(1, 8, 2 * i), Normals(1, 8, 2 * i + 1), 1) / 400;
  CHECK(std::abs(mean) < 0.015);  // the biased estimate would have a mean of 0.13
}

TEST_CASE("sliced Wasserstein: a shift, and sets of unequal sizes") {
  const Eigen::MatrixXd x = Normals(1, 30, 3), one = Eigen::MatrixXd::Ones(1, 1);
  CHECK(SlicedWasserstein(x, x.array() + 2, one) == Approx(4));
  const Eigen::RowVector2d a(0, 1);
  const Eigen::RowVector3d b(0, 1, 2);  // couples 1/3: 0-0, 1/6: 0-1, 1/6: 1-1, 1/3: 1-2
  CHECK(SlicedWasserstein(a, b, one) == Approx(1. / 6 + 1. / 3));
  // Every sample twice is the same distribution.
  Eigen::MatrixXd twice(1, 60);
  twice << x, x;
  CHECK(SlicedWasserstein(x, twice, one) == Approx(0).margin(1e-12));
}

TEST_CASE("distances by name are whitened, fair, and know failures") {
  const Eigen::MatrixXd recorded = Normals(2, 200, 1);
  for (const char* name : {"energy", "mmd", "sliced-wasserstein"}) {
    CAPTURE(name);
    const SetDistance distance = MakeDistance(name, recorded);
    const double near = distance(Normals(2, 150, 2)), far = distance(Normals(2, 150, 2, 1));
    CHECK(near < far);
    const Eigen::Vector2d units(1e3, 1e-2);
    const SetDistance scaled = MakeDistance(name, units.asDiagonal() * recorded);
    // Ridges differ in units, hence not exactly.
    CHECK(scaled(units.asDiagonal() * Normals(2, 150, 2, 1)) > 0.2 * far);
    Eigen::MatrixXd failed = Normals(2, 150, 2);
    failed(1, 7) = std::nan("");
    CHECK(std::isinf(distance(failed)));
    CHECK(std::isinf(distance(Eigen::MatrixXd(2, 0))));
  }
  CHECK_THROWS_WITH(MakeDistance("euclid", recorded), Catch::Contains("sliced-wasserstein"));
  CHECK_THROWS_AS(MakeDistance("energy", Eigen::MatrixXd(2, 0)), std::invalid_argument);
}

TEST_CASE("distances of outcomes leave out what was not observed and what has no scale") {
  Eigen::MatrixXd outcomes(4, 2);
  outcomes << 1, 0,  //
      9, 9,          //
      5, 5,          //
      2, std::nan("");
  const Eigen::Vector4d observed(-1, std::nan(""), 0, 0), scale(2, 1, 0, 0.5);
  CHECK(Distances("squared", outcomes, observed, scale)(0) == Approx(1 + 16));
  CHECK(Distances("absolute", outcomes, observed, scale)(0) == Approx(1 + 4));
  CHECK(Distances("mahalanobis", outcomes, observed, scale)(0) == Approx(std::sqrt(17)));
  CHECK(std::isinf(Distances("squared", outcomes, observed, scale)(1)));
  CHECK_THROWS_WITH(Distances("energy", outcomes, observed, scale), Catch::Contains("mahalanobis"));
}

TEST_CASE("scales are those of the noise, whatever a few outliers and failures do") {
  Eigen::MatrixXd outcomes = Normals(3, 4'001, 4);
  outcomes.row(1) *= 5;
  outcomes.row(2).setConstant(3);
  outcomes.row(0).head(200).setConstant(1e9);
  outcomes(0, 300) = std::nan("");
  const Eigen::VectorXd deviation = MedianDeviation(outcomes);
  CHECK(deviation(0) == Approx(1).epsilon(0.12));
  CHECK(deviation(1) == Approx(5).epsilon(0.06));
  CHECK(deviation(2) == 0);
  // An outlier of the observation counts for little; where everything is off, it is the simulator.
  CHECK(RobustScale(outcomes, Eigen::Vector3d(0, 100, 3))(1) == Approx(105).epsilon(0.02));
  CHECK(RobustScale(outcomes, Eigen::Vector3d(50, 100, 3))(1) == Approx(5).epsilon(0.06));
}

}  // namespace
}  // namespace plumb
