#include "calibrator/inference/prior.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

namespace plumb {
namespace {

TEST_CASE("standard coordinates of a prior are standard normal, both ways, far into the tails") {
  const Prior prior({Prior::Normal(3, 0.5), Prior::Uniform(-2, 6)});
  Eigen::MatrixXd x(2, 3);
  x << 3, 3.5, 0,  //
      2, -2 + 8 * 0.84134474606854293, 6 - 8e-12;
  const Eigen::MatrixXd u = prior.ToStandard(x);
  CHECK(u(0, 0) == 0);
  CHECK(u(0, 1) == Approx(1));
  CHECK(u(1, 0) == 0);
  CHECK(u(1, 1) == Approx(1));
  CHECK(u(1, 2) == Approx(7.0344838253).epsilon(1e-4));  // -Phi^-1(1e-12)
  CHECK((prior.FromStandard(u) - x).cwiseAbs().maxCoeff() < 1e-14);
}

TEST_CASE("the prior's density integrates to one, and is zero out of bounds") {
  const Prior prior({Prior::Normal(0, 2), Prior::Uniform(1, 4)});
  double sum = 0;
  for (double a = -12; a < 12; a += 0.05) {
    for (double b = 0.95; b < 4.1; b += 0.1)
      sum += std::exp(prior.LogDensity(Eigen::Vector2d(a, b))) * 0.05 * 0.1;
  }
  CHECK(sum == Approx(1).epsilon(1e-6));
  CHECK(prior.LogDensity(Eigen::Vector2d(0, 4.01)) == -std::numeric_limits<double>::infinity());
}

TEST_CASE("draws of a prior have its moments") {
  const Prior prior({Prior::Normal(3, 0.5), Prior::Uniform(-2, 6)});
  Random random(5);
  const Eigen::MatrixXd draws = prior.Sample(20'000, random);
  CHECK(draws.row(0).mean() == Approx(3).margin(0.015));
  CHECK(draws.row(1).mean() == Approx(2).margin(0.07));
  CHECK(draws.row(1).minCoeff() >= -2);
  CHECK(draws.row(1).maxCoeff() <= 6);
  CHECK((draws.row(1).array() - 2).square().mean() == Approx(64.0 / 12).epsilon(0.05));
}

TEST_CASE("what is no distribution is refused") {
  CHECK_THROWS_AS(Prior(std::vector<Prior::Marginal>{}), std::invalid_argument);
  CHECK_THROWS_AS(Prior({Prior::Normal(0, 0)}), std::invalid_argument);
  CHECK_THROWS_AS(Prior({Prior::Uniform(1, 1)}), std::invalid_argument);
  CHECK_THROWS_AS(Prior({Prior::Uniform(0, std::nan(""))}), std::invalid_argument);
}

}  // namespace
}  // namespace plumb
