#include "calibrator/inference/laplace.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <stdexcept>

#include "common/decompositions.h"
#include "common/special_numbers.h"
#include "tests/calibrator/inference/least_squares_problem.h"
#include "tests/calibrator/inference/statistics.h"

namespace plumb {
namespace {

// Of a normal prior and a normal likelihood with that noise.
Gaussian Conjugate(const Prior& prior, const Eigen::MatrixXd& a, const Eigen::VectorXd& y,
                   double s) {
  const Eigen::Index n = prior.size();
  Eigen::VectorXd mean(n), precision(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto& m = prior.marginals()[static_cast<size_t>(i)];
    mean(i) = m.a, precision(i) = 1 / (m.b * m.b);
  }
  const Eigen::MatrixXd posterior =
      a.transpose() * a / (s * s) + Eigen::MatrixXd(precision.asDiagonal());
  return {Inverse(posterior) * (a.transpose() * y / (s * s) + precision.cwiseProduct(mean)),
          Inverse(posterior)};
}

TEST_CASE("a line with normal noise has the posterior of the textbook") {
  const bool known = GENERATE(false, true);
  const Prior prior = SomePrior();
  const Eigen::MatrixXd a = Normals(200, 3, 1);
  const double noise = known ? 1 : 0.3;
  const Eigen::VectorXd y = a * Eigen::Vector3d(2, -0.5, 0.7) + noise * Normals(200, 1, 2);
  LeastSquares problem = Line(prior, y, a);
  problem.scale_known = known;
  LaplaceOptions options;
  options.tolerance = 1e-9;
  options.sandwich = options.robust = false;
  const LaplaceFit fit = FitLaplace(problem, Eigen::Vector3d(-3, 1, 2), options);
  CHECK(fit.converged);
  const double s = fit.scale(0);
  const Gaussian truth = Conjugate(prior, a, y, s);
  CHECK((fit.mode - truth.mean).norm() < 1e-6);
  CHECK((fit.posterior.covariance - truth.covariance).norm() < 1e-6 * truth.covariance.norm());
  CHECK((fit.information - a.transpose() * a / (s * s)).norm() < 1e-6 * fit.information.norm());
  CHECK((fit.errors * s - (a * truth.mean - y)).norm() < 1e-5);
  CHECK((fit.jacobian * s - a).norm() < 1e-5);
  // The scale, from its definition: effective parameters are what the data tell of n.
  const double squares = (a * truth.mean - y).squaredNorm();
  const double effective = (truth.covariance * a.transpose() * a / (s * s)).trace();
  CHECK(effective < 3);
  const double variance =
      known ? (squares + 20) / (200 - effective + 20) : squares / (200 - effective);
  CHECK(s * s == Approx(variance).epsilon(1e-6));
  CHECK(s == Approx(noise).epsilon(0.15));
  // Draws have these moments.
  Random random(3);
  const Eigen::MatrixXd draws = Draw(fit, prior, 20'000, random);
  const Eigen::MatrixXd centred = draws.colwise() - truth.mean;
  CHECK((centred.rowwise().mean().array() / truth.covariance.diagonal().array().sqrt())
            .abs()
            .maxCoeff() < 0.03);
  CHECK((centred * centred.transpose() / 20'000 - truth.covariance).norm() <
        0.03 * truth.covariance.norm());
}

// Mean and covariance of the posterior with an unknown scale s of prior 1 / s, by a sum over a grid
// in u.
template <typename Model>
Gaussian OnGrid(const Prior& prior, const Eigen::VectorXd& y, const Model& model,
                const Eigen::VectorXd& lower, const Eigen::VectorXd& upper) {
  constexpr int kPoints = 300;
  const Eigen::Index n = prior.size();
  const int count = n == 1 ? kPoints : kPoints * kPoints;
  Eigen::MatrixXd x(n, count);
  Eigen::VectorXd log_density(count);
  for (int i = 0; i < count; ++i) {
    Eigen::VectorXd u(n);
    for (Eigen::Index k = 0; k < n; ++k) {
      const int at = k == 0 ? i % kPoints : i / kPoints;
      u(k) = lower(k) + (upper(k) - lower(k)) * (at + 0.5) / kPoints;
    }
    x.col(i) = prior.FromStandard(u);
    log_density(i) =
        -0.5 * u.squaredNorm() - 0.5 * static_cast<double>(y.size()) *
                                     std::log((model(Eigen::VectorXd(x.col(i))) - y).squaredNorm());
  }
  Eigen::VectorXd w = (log_density.array() - log_density.maxCoeff()).exp();
  w /= w.sum();
  const Eigen::VectorXd mean = x * w;
  const Eigen::MatrixXd centred = x.colwise() - mean;
  return {mean, centred * w.asDiagonal() * centred.transpose()};
}

TEST_CASE("a curve's posterior is that of a sum over a grid") {
  SECTION("one parameter") {
    const Prior prior({Prior::Normal(0.5, 1)});
    const auto model = [](const Eigen::VectorXd& x) -> Eigen::VectorXd {
      return Eigen::ArrayXd::LinSpaced(50, 0, 3).unaryExpr(
          [&](double t) { return std::exp(-std::exp(x(0)) * t); });
    };
    const Eigen::VectorXd y = model(Eigen::VectorXd::Constant(1, -0.4)) + 0.1 * Normals(50, 1, 5);
    LaplaceOptions options;
    options.sandwich = false;
    const LaplaceFit fit =
        FitLaplace(Fitting(prior, y, model), Eigen::VectorXd::Constant(1, 2.5), options);
    const Gaussian truth =
        OnGrid(prior, y, model, Eigen::VectorXd::Constant(1, -2), Eigen::VectorXd::Constant(1, 1));
    const double sd = std::sqrt(truth.covariance(0, 0));
    CHECK(std::abs(fit.mode(0) - truth.mean(0)) < 0.1 * sd);
    CHECK(std::sqrt(fit.posterior.covariance(0, 0)) == Approx(sd).epsilon(0.06));
  }
  SECTION("two parameters, one of them between bounds") {
    const Prior prior({Prior::Normal(0, 1), Prior::Uniform(0, 2)});
    const auto model = [](const Eigen::VectorXd& x) -> Eigen::VectorXd {
      return Eigen::ArrayXd::LinSpaced(80, 0, 4).unaryExpr(
          [&](double t) { return std::exp(x(0)) * std::sin(x(1) * t); });
    };
    const Eigen::VectorXd y = model(Eigen::Vector2d(0.3, 1.3)) + 0.2 * Normals(80, 1, 6);
    LaplaceOptions options;
    options.sandwich = false;
    const LaplaceFit fit =
        FitLaplace(Fitting(prior, y, model), Eigen::Vector2d(-0.5, 0.9), options);
    const Gaussian truth =
        OnGrid(prior, y, model, Eigen::Vector2d(0, 0.2), Eigen::Vector2d(0.6, 0.6));
    const Eigen::Vector2d sd = truth.covariance.diagonal().cwiseSqrt();
    CHECK(((fit.mode - truth.mean).array() / sd.array()).abs().maxCoeff() < 0.2);
    CHECK((fit.posterior.covariance - truth.covariance).norm() < 0.1 * truth.covariance.norm());
  }
}

TEST_CASE("where the data lie beyond a uniform prior's bound the posterior leans on it") {
  const Prior prior({Prior::Uniform(0, 1)});
  const Eigen::VectorXd y = Eigen::VectorXd::Constant(40, 1.02) + 0.1 * Normals(40, 1, 7);
  const auto model = [](const Eigen::VectorXd& x) -> Eigen::VectorXd {
    return Eigen::VectorXd::Constant(40, x(0));
  };
  const LaplaceFit fit = FitLaplace(Fitting(prior, y, model), Eigen::VectorXd::Constant(1, 0.2));
  CHECK(fit.converged);
  Random random(3);
  const Eigen::MatrixXd draws = Draw(fit, prior, 20'000, random);
  CHECK(draws.maxCoeff() <= 1);
  CHECK(draws.minCoeff() > 0.7);
  const Gaussian truth =
      OnGrid(prior, y, model, Eigen::VectorXd::Constant(1, 0), Eigen::VectorXd::Constant(1, 5));
  CHECK(1 - draws.mean() == Approx(1 - truth.mean(0)).epsilon(0.5));
  // On the bound itself there is no way to tell in which direction to go.
  CHECK_THROWS_AS(FitLaplace(Fitting(prior, y, model), Eigen::VectorXd::Ones(1)),
                  std::invalid_argument);
}

TEST_CASE("a direction that changes nothing keeps the prior") {
  const Prior prior({Prior::Normal(2, 1), Prior::Normal(0, 1), Prior::Normal(1, 3)});
  Eigen::MatrixXd a = Normals(100, 3, 8);
  a.col(1) = a.col(0);  // only x0 + x1 counts
  a.col(2).setZero();
  const Eigen::VectorXd y = a * Eigen::Vector3d(1, 2, 5) + 0.01 * Normals(100, 1, 9);
  const LaplaceFit fit = FitLaplace(Line(prior, y, a), Eigen::Vector3d::Zero());
  Random random(4);
  const Eigen::MatrixXd draws = Draw(fit, prior, 3000, random);
  CHECK(KolmogorovSmirnov((draws.row(0) - draws.row(1)).transpose(), 2, std::sqrt(2)) > 0.01);
  CHECK(KolmogorovSmirnov(draws.row(2).transpose(), 1, 3) > 0.01);
  // of which the data do tell
  CHECK(KolmogorovSmirnov((draws.row(0) + draws.row(1)).transpose(), 3, 1) < 1e-6);
  CHECK(fit.mode(2) == Approx(1).margin(1e-9));
  CHECK(fit.posterior.covariance(2, 2) == Approx(9).epsilon(1e-9));
  CHECK(fit.mode(0) - fit.mode(1) == Approx(2).margin(1e-6));
}

TEST_CASE("data without noise are explained exactly, and the end is found") {
  const Prior prior({Prior::Normal(0, 1), Prior::Normal(0, 1)});
  const auto model = [](const Eigen::VectorXd& x) -> Eigen::VectorXd {
    return Eigen::ArrayXd::LinSpaced(60, 0, 3).unaryExpr(
        [&](double t) { return std::exp(x(0)) * std::sin(std::exp(x(1)) * t); });
  };
  const Eigen::Vector2d truth(0.4, 0.3);
  const LaplaceFit fit = FitLaplace(Fitting(prior, model(truth), model), Eigen::Vector2d::Zero());
  CHECK(fit.converged);
  CHECK((fit.mode - truth).norm() < 1e-8);
  CHECK(fit.scale(0) == Approx(1e-9));
  CHECK(fit.simulations < 60);
  CHECK(fit.posterior.covariance.diagonal().maxCoeff() < 1e-18);
}

TEST_CASE("a border beyond which simulations fail does not stop the fit") {
  const Prior prior({Prior::Normal(0, 2), Prior::Normal(0, 2)});
  const auto model = [](const Eigen::VectorXd& x) -> Eigen::VectorXd {
    Eigen::ArrayXd t = Eigen::ArrayXd::LinSpaced(60, 0, 3);
    if (x(0) > 1.05 || x(1) < -1) return Eigen::VectorXd::Constant(60, kNaN);
    return (x(0) * t).exp() + x(1) * t;
  };
  const Eigen::VectorXd y = model(Eigen::Vector2d(1, 0.5)) + 0.1 * Normals(60, 1, 13);
  LaplaceOptions options;
  options.tolerance = 1e-6;
  const LaplaceFit near = FitLaplace(Fitting(prior, y, model), Eigen::Vector2d(1, 0.5), options);
  CHECK(near.mode(0) == Approx(1).margin(0.02));
  // From below, the first steps lead across the border; from the border itself, the only slope is
  // the backward one.
  for (const Eigen::Vector2d& start : {Eigen::Vector2d(0.2, 0), Eigen::Vector2d(1.05, -1)}) {
    const LaplaceFit fit = FitLaplace(Fitting(prior, y, model), start, options);
    CHECK(fit.converged);
    CHECK((fit.mode - near.mode).norm() < 1e-5);
  }
  // Right on the border lies the best that can be had.
  const Eigen::VectorXd beyond = (1.2 * Eigen::ArrayXd::LinSpaced(60, 0, 3)).exp();
  CHECK(FitLaplace(Fitting(prior, beyond, model), Eigen::Vector2d(0, 0)).mode(0) ==
        Approx(1.05).margin(0.1));
}

TEST_CASE("what cannot be fitted is refused") {
  const Prior prior = SomePrior();
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  const Eigen::MatrixXd a = Normals(6, 3, 14);
  CHECK_NOTHROW(FitLaplace(Line(prior, Eigen::VectorXd::Ones(6), a), zero));
  CHECK_THROWS_AS(FitLaplace(Line(prior, Eigen::VectorXd::Ones(5), a.topRows(5)), zero),
                  std::invalid_argument);
  LeastSquares known = Line(prior, Eigen::VectorXd::Ones(5), a.topRows(5));
  known.scale_known = true;
  CHECK_NOTHROW(FitLaplace(known, zero));
  CHECK_THROWS_AS(FitLaplace(Line(prior, Eigen::VectorXd::Ones(6), a), Eigen::Vector2d::Zero()),
                  std::invalid_argument);
  LeastSquares uneven = Line(prior, Eigen::VectorXd::Ones(6), a);
  uneven.block.pop_back();
  CHECK_THROWS_AS(FitLaplace(uneven, zero), std::invalid_argument);
  uneven.block = uneven.cluster = uneven.group = Numbers(5);
  CHECK_THROWS_AS(FitLaplace(uneven, zero), std::invalid_argument);
  LeastSquares failing = Line(prior, Eigen::VectorXd::Constant(6, kNaN), a);
  CHECK_THROWS_AS(FitLaplace(failing, zero), std::invalid_argument);
}

TEST_CASE("no iteration at all looks at the start as it is") {
  const Prior prior = SomePrior();
  const Eigen::MatrixXd a = Normals(100, 3, 15);
  const Eigen::Vector3d at(1, -1, 0.5);
  const Eigen::VectorXd y = a * Eigen::Vector3d(2, -0.5, 0.7) + Normals(100, 1, 16);
  LaplaceOptions curvature_only;
  curvature_only.max_iterations = 0;
  curvature_only.robust = curvature_only.sandwich = false;
  const LaplaceFit fit = FitLaplace(Line(prior, y, a), at, curvature_only);
  CHECK((fit.mode - at).norm() < 1e-12);
  const Eigen::VectorXd errors = a * at - y;
  const double s = fit.scale(0);
  CHECK((fit.jacobian * s - a).norm() < 1e-5);
  CHECK((fit.errors * s - errors).norm() < 1e-9);
  const double effective =
      (Conjugate(prior, a, y, s).covariance * a.transpose() * a / (s * s)).trace();
  CHECK(s * s == Approx(errors.squaredNorm() / (100 - effective)).epsilon(0.002));
}

}  // namespace
}  // namespace plumb
