#include "estimator/model/unscented_filter.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "common/decompositions.h"
#include "common/random.h"

namespace plumb {
namespace {

Eigen::MatrixXd RandomMatrix(Random& random, Eigen::Index rows, Eigen::Index cols) {
  Eigen::MatrixXd m(rows, cols);
  for (Eigen::Index i = 0; i < m.size(); ++i) m.data()[i] = random.Normal();
  return m;
}

// Independent truth: Kalman's equations as matrices, with an inverse.
TEST_CASE("of a linear motion it is the Kalman filter") {
  constexpr Eigen::Index n = 5;
  Random random(1, {7});
  const Eigen::MatrixXd transition =
      Eigen::MatrixXd::Identity(n, n) + 0.1 * RandomMatrix(random, n, n);
  const Eigen::MatrixXd root = 0.2 * RandomMatrix(random, n, n), noise = root * root.transpose();
  const Eigen::MatrixXd rows = RandomMatrix(random, 2, n);
  const Eigen::Vector2d variances(0.3, 1e-3);
  Eigen::VectorXd mean = RandomMatrix(random, n, 1), sd = Eigen::VectorXd::LinSpaced(n, 0.1, 2);
  Eigen::MatrixXd covariance = sd.cwiseAbs2().asDiagonal();
  UnscentedFilter filter(n);
  filter.Restart(mean, sd);
  for (int k = 0; k < 300; ++k) {
    const Eigen::Vector2d reading = RandomMatrix(random, 2, 1);
    REQUIRE(filter.Predict([&](Eigen::Ref<Eigen::VectorXd> x) { return x = transition * x, true; },
                           noise));
    mean = transition * mean;
    covariance = transition * covariance * transition.transpose() + noise;
    const Eigen::Matrix2d expected =
        rows * covariance * rows.transpose() + Eigen::Matrix2d(variances.asDiagonal());
    const auto innovation = filter.Expect(rows.row(0).transpose(), reading(0), variances(0));
    CHECK(innovation.value == Approx(reading(0) - rows.row(0).dot(mean)).epsilon(1e-9));
    CHECK(innovation.variance == Approx(expected(0, 0)).epsilon(1e-9));
    for (Eigen::Index i = 0; i < 2; ++i)
      filter.Correct(rows.row(i).transpose(), reading(i), variances(i));
    const Eigen::MatrixXd gain = covariance * rows.transpose() * expected.inverse();
    mean += gain * (reading - rows * mean);
    covariance = (Eigen::MatrixXd::Identity(n, n) - gain * rows) * covariance;
  }
  CHECK((filter.mean() - mean).norm() < 1e-8 * mean.norm());
  CHECK((filter.covariance() - covariance).norm() < 1e-8 * covariance.norm());
  CHECK(filter.covariance() == filter.covariance().transpose());
}

// For x ~ N(m, s^2): E[x^2] = m^2 + s^2, var x^2 = 2 s^4 + 4 m^2 s^2.
TEST_CASE("of a square it has the exact mean and variance") {
  UnscentedFilter filter(1);
  for (const double m : {0.0, 0.7, -3.0}) {
    const double s = 0.4;
    filter.Restart(Eigen::VectorXd::Constant(1, m), Eigen::VectorXd::Constant(1, s));
    REQUIRE(
        filter.Predict([](Eigen::Ref<Eigen::VectorXd> x) { return x = x.cwiseAbs2().eval(), true; },
                       Eigen::MatrixXd::Zero(1, 1)));
    CHECK(filter.mean()(0) == Approx(m * m + s * s).epsilon(1e-12));
    CHECK(filter.covariance()(0, 0) ==
          Approx(2 * std::pow(s, 4) + 4 * m * m * s * s).epsilon(1e-12));
  }
}

TEST_CASE("a covariance stays one through a thousand exact readings") {
  UnscentedFilter filter(3);
  filter.Restart(Eigen::Vector3d::Zero(), Eigen::Vector3d(1, 1e4, 1e-4));
  for (int k = 0; k < 1000; ++k) {
    REQUIRE(filter.Predict([](Eigen::Ref<Eigen::VectorXd> x) { return x(0) += 1e-3 * x(1), true; },
                           1e-14 * Eigen::Matrix3d::Identity()));
    filter.Correct(Eigen::Vector3d(1, 0, 1), 0.1 * k, 1e-12);
    REQUIRE(filter.covariance().diagonal().minCoeff() > 0);
  }
  CHECK(filter.mean()(1) == Approx(100).epsilon(1e-6));
}

TEST_CASE(
    "a motion that fails leaves the filter as it was, and so does a covariance that is none") {
  UnscentedFilter filter(2);
  filter.Restart(Eigen::Vector2d(1, 2), Eigen::Vector2d(1, 1));
  int asked = 0;
  CHECK_FALSE(
      filter.Predict([&](Eigen::Ref<Eigen::VectorXd> x) { return x.setZero(), ++asked < 4; },
                     Eigen::Matrix2d::Zero()));
  CHECK(filter.mean() == Eigen::Vector2d(1, 2));
  CHECK(filter.covariance() == Eigen::Matrix2d::Identity());
  filter.Restart(Eigen::Vector2d(1, 2), Eigen::Vector2d(NAN, 1));
  CHECK_FALSE(
      filter.Predict([](Eigen::Ref<Eigen::VectorXd>) { return true; }, Eigen::Matrix2d::Zero()));
}

}  // namespace
}  // namespace plumb
