#include "experiments/population_weights.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "common/gaussian.h"

namespace plumb {
namespace {

// 21 simulators, n at (n - 10) / 5 in every transition, moved by something that depends on it; the
// robot is at -1 in three transitions of ten, at 1 in the others.
struct Bimodal {
  std::vector<Eigen::MatrixXd> predictions;
  Eigen::MatrixXd outcomes{1, 400};
  Bimodal() {
    for (int t = 0; t < 400; ++t) {
      Random random(1, {static_cast<uint32_t>(t)});
      const double moved = random.Normal();
      predictions.push_back((Eigen::RowVectorXd::LinSpaced(21, -2, 2).array() + moved).matrix());
      outcomes(0, t) = (t % 10 < 3 ? -1 : 1) + moved;
    }
  }
};

TEST_CASE("a population of two modes is recovered, where least squares lands between them") {
  const Bimodal robot;
  const PopulationWeights fit = FitPopulation(robot.predictions, robot.outcomes);
  CHECK(fit.weights(5) == Approx(0.3).margin(1e-3));
  CHECK(fit.weights(15) == Approx(0.7).margin(1e-3));
  CHECK(fit.weights.sum() == Approx(1));
  CHECK(fit.weights.minCoeff() >= 0);
  // E|X - y| - E|X - X'| / 2 of that population: 2 * 2 * 0.3 * 0.7 - 0.3 * 0.7 * 2
  CHECK(fit.score == Approx(0.42).epsilon(1e-4));

  int best = 0;
  double least = 1e9;
  for (int n = 0; n < 21; ++n) {
    double sum = 0;
    for (size_t t = 0; t < 400; ++t)
      sum +=
          std::pow(robot.predictions[t](0, n) - robot.outcomes(0, static_cast<Eigen::Index>(t)), 2);
    if (sum < least) best = n, least = sum;
  }
  CHECK(best == 12);  // at 0.4, where the robot never is
  CHECK(fit.weights(12) == Approx(0).margin(1e-3));
}

TEST_CASE("no other weights have a better score, and the gap says so") {
  Random random(2);
  std::vector<Eigen::MatrixXd> predictions;
  for (int t = 0; t < 30; ++t) predictions.push_back(StandardNormals(2, 6, random));
  const Eigen::MatrixXd outcomes = StandardNormals(2, 30, random);
  const PopulationWeights fit = FitPopulation(predictions, outcomes, 1e-8);
  CHECK(fit.gap < 1e-7);
  const auto score = [&](const Eigen::VectorXd& w) {
    double sum = 0;
    for (int t = 0; t < 30; ++t) {
      const Eigen::MatrixXd& x = predictions[static_cast<size_t>(t)];
      for (int i = 0; i < 6; ++i) {
        sum += w(i) * (x.col(i) - outcomes.col(t)).norm() / 30;
        for (int j = 0; j < 6; ++j) sum -= w(i) * w(j) * (x.col(i) - x.col(j)).norm() / 60;
      }
    }
    return sum;
  };
  CHECK(fit.score == Approx(score(fit.weights)));
  for (int trial = 0; trial < 500; ++trial) {
    Eigen::VectorXd w(6);
    for (double& x : w) x = -std::log(1 - random.Uniform());
    // Anywhere on the simplex, and near the solution.
    w = (w / w.sum() + (trial % 2) * 20 * fit.weights) / (1 + (trial % 2) * 20);
    REQUIRE(score(w) >= fit.score - 1e-7);
  }
}

TEST_CASE("failed simulators have no weight; all failed is an error") {
  Bimodal robot;
  robot.predictions[17](0, 5) = std::nan("");
  const PopulationWeights fit = FitPopulation(robot.predictions, robot.outcomes);
  CHECK(fit.failed == 1);
  CHECK(fit.weights(5) == 0);
  CHECK(fit.weights(4) + fit.weights(6) == Approx(0.3).margin(0.02));
  robot.predictions[3].setConstant(std::nan(""));
  CHECK_THROWS_AS(FitPopulation(robot.predictions, robot.outcomes), std::invalid_argument);
  CHECK_THROWS_AS(FitPopulation({}, Eigen::MatrixXd(1, 0)), std::invalid_argument);
}

}  // namespace
}  // namespace plumb
