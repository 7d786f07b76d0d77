#include "calibrator/inference/reps.h"

#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "common/random.h"

namespace plumb {
namespace {

Eigen::VectorXd SomeReturns(int n) {
  Random random(3);
  Eigen::VectorXd r(n);
  for (double& x : r) x = -50 * random.Uniform() * random.Uniform();
  return r;
}

// The dual as written, without shift or log-sum-exp; only for returns of moderate size.
double Dual(const Eigen::VectorXd& r, double eta, double epsilon) {
  return eta * epsilon + eta * std::log((r.array() / eta).exp().mean());
}

TEST_CASE("the temperature minimises the dual and the weights meet the bound") {
  const Eigen::VectorXd returns = SomeReturns(25);
  const RepsWeights w = SolveReps(returns, 0.1, 1e-3);
  CHECK(w.kl == Approx(0.1).epsilon(1e-9));
  CHECK(w.weights.sum() == Approx(1));
  const double at = Dual(returns, w.temperature, 0.1);
  CHECK(at < Dual(returns, 1.05 * w.temperature, 0.1));
  CHECK(at < Dual(returns, 0.95 * w.temperature, 0.1));
  // KL(w || uniform), from its definition
  double kl = 0;
  for (const double x : w.weights) kl += x * std::log(25 * x);
  CHECK(kl == Approx(0.1).epsilon(1e-9));
}

TEST_CASE("weights depend on differences of returns only, and scale with the temperature") {
  const Eigen::VectorXd returns = SomeReturns(25);
  const RepsWeights w = SolveReps(returns, 0.1, 1e-3);
  const RepsWeights shifted = SolveReps(returns.array() - 1e6, 0.1, 1e-3);
  const RepsWeights scaled = SolveReps(1e4 * returns, 0.1, 1e-3);
  CHECK((w.weights - shifted.weights).norm() < 1e-6);
  CHECK((w.weights - scaled.weights).norm() < 1e-9);
  CHECK(scaled.temperature == Approx(1e4 * w.temperature).epsilon(1e-9));
}

TEST_CASE("hard cases of the dual") {
  SECTION("equal returns give equal weights") {
    const RepsWeights w = SolveReps(Eigen::VectorXd::Constant(10, -7), 0.1, 1);
    CHECK(w.ess == Approx(10));
    CHECK(w.temperature == 1);
  }
  SECTION("the minimum temperature rules where the bound asks for less") {
    const RepsWeights w = SolveReps(1e-3 * SomeReturns(25), 0.1, 1);
    CHECK(w.temperature == 1);
    CHECK(w.kl < 0.1);
  }
  SECTION("impossible samples get nothing") {
    Eigen::VectorXd returns = SomeReturns(25);
    returns(3) = returns(9) = -std::numeric_limits<double>::infinity();
    const RepsWeights w = SolveReps(returns, 0.2, 1e-3);
    CHECK(w.weights(3) == 0);
    CHECK(w.weights(9) == 0);
    CHECK(w.kl == Approx(0.2));
  }
  SECTION("ties among the best that put the bound out of reach") {
    Eigen::VectorXd returns = Eigen::VectorXd::Zero(10);
    returns(0) = -1;
    const RepsWeights w = SolveReps(returns, 0.5, 1e-6);
    CHECK(w.weights(0) == Approx(0).margin(1e-12));
    CHECK(w.ess == Approx(9));
  }
  SECTION("most samples impossible: nothing overflows, the bound cannot be met") {
    Eigen::VectorXd returns =
        Eigen::VectorXd::Constant(10, -std::numeric_limits<double>::infinity());
    returns(4) = -3;
    CHECK(SolveReps(returns, 0.1, 1).weights(4) == 1);
  }
  SECTION("rubbish is refused") {
    CHECK_THROWS(SolveReps(Eigen::VectorXd(), 0.1, 1));
    CHECK_THROWS(SolveReps(Eigen::VectorXd::Constant(3, std::nan("")), 0.1, 1));
    CHECK_THROWS(
        SolveReps(Eigen::VectorXd::Constant(3, -std::numeric_limits<double>::infinity()), 0.1, 1));
  }
}

Gaussian ExampleGaussian() {
  Eigen::MatrixXd covariance(2, 2);
  covariance << 2, 0.5, 0.5, 1;
  return {Eigen::Vector2d(1, -2), covariance};
}

TEST_CASE("samples have the moments asked for, and fitting them gives the Gaussian back") {
  const Gaussian p = ExampleGaussian();
  Random random(11);
  Eigen::MatrixXd normals(2, 20000);
  for (Eigen::Index j = 0; j < normals.cols(); ++j)
    normals.col(j) << random.Normal(), random.Normal();
  const Eigen::MatrixXd samples = Transform(p, normals);
  const RepsWeights equal = SolveReps(Eigen::VectorXd::Zero(20000), 0.1, 1);
  const Gaussian fit = FitGaussian(samples, equal, p);
  CHECK((fit.mean - p.mean).norm() < 0.03);
  CHECK((fit.covariance - p.covariance).norm() < 0.06);
}

TEST_CASE("few samples leave the covariance near the prior's, and unbiased on average") {
  const Gaussian p = ExampleGaussian();
  Eigen::Matrix2d mean = Eigen::Matrix2d::Zero();
  constexpr int kTrials = 4000;
  for (uint32_t trial = 0; trial < kTrials; ++trial) {
    Random random(5, {trial});
    Eigen::MatrixXd normals(2, 6);
    for (double& x : normals.reshaped()) x = random.Normal();
    mean += FitGaussian(Transform(p, normals), SolveReps(Eigen::VectorXd::Zero(6), 0.1, 1), p)
                .covariance /
            kTrials;
  }
  CHECK((mean - p.covariance).norm() < 0.06);
}

TEST_CASE("the KL bound holds for the distribution itself") {
  const Gaussian old = ExampleGaussian();
  Gaussian target{Eigen::Vector2d(4, 1), 0.01 * Eigen::Matrix2d::Identity()};
  const Gaussian limited = LimitKl(old, target, 0.1);
  CHECK(KlDivergence(limited, old) == Approx(0.1).epsilon(1e-6));
  CHECK(KlDivergence(limited, target) < KlDivergence(old, target));
  const Gaussian near = LimitKl(old, old, 0.1);
  CHECK((near.covariance - old.covariance).norm() == 0);
}

}  // namespace
}  // namespace plumb
