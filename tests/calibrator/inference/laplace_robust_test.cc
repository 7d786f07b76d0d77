#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "calibrator/inference/laplace.h"
#include "calibrator/inference/sandwich.h"
#include "common/special_numbers.h"
#include "tests/calibrator/inference/least_squares_problem.h"

namespace plumb {
namespace {

TEST_CASE("outliers do little harm, and normal errors are taken as such") {
  const Prior prior = SomePrior();
  const Eigen::MatrixXd a = Normals(300, 3, 10);
  const Eigen::Vector3d truth(2, -0.5, 0.7);
  const Eigen::VectorXd clean = a * truth + 0.1 * Normals(300, 1, 11);
  Eigen::VectorXd spoilt = clean;
  for (int i = 0; i < 300; i += 10) spoilt(i) += i % 20 ? 3 : 4;
  LaplaceOptions trusting;
  trusting.robust = false;
  const LaplaceFit from_clean = FitLaplace(Line(prior, clean, a), Eigen::Vector3d::Zero());
  const LaplaceFit robust = FitLaplace(Line(prior, spoilt, a), Eigen::Vector3d::Zero());
  const LaplaceFit fooled = FitLaplace(Line(prior, spoilt, a), Eigen::Vector3d::Zero(), trusting);
  const Eigen::ArrayXd sd = from_clean.posterior.covariance.diagonal().array().sqrt();
  const auto distance = [&](const LaplaceFit& fit) {
    return ((fit.mode - from_clean.mode).array() / sd).abs().maxCoeff();
  };
  CHECK(from_clean.degrees_of_freedom == kInfinity);
  CHECK(robust.degrees_of_freedom == 2);
  CHECK(fooled.degrees_of_freedom == kInfinity);
  CHECK(distance(robust) < 0.7);
  CHECK(distance(fooled) > 3);
  CHECK(robust.scale(0) == Approx(0.1).epsilon(0.25));
  int heavy = 0;
  for (uint32_t i = 0; i < 100; ++i) {
    heavy +=
        std::isfinite(FitLaplace(Line(prior, a * truth + 0.1 * Normals(300, 1, 1000 + i), a), truth)
                          .degrees_of_freedom);
  }
  CHECK(heavy <= 1);
}

// Of t with f degrees of freedom.
double StudentT(double f, Random& random) {
  double chi_squared = 0;
  for (int i = 0; i < f; ++i) chi_squared += std::pow(random.Normal(), 2);
  return random.Normal() / std::sqrt(chi_squared / f);
}

// Share of the 95 % intervals of all parameters that hold the truth.
template <typename MakeNoise>
double Coverage(const LeastSquares& form, const Eigen::MatrixXd& a, int sets,
                const LaplaceOptions& options, const MakeNoise& noise, int* widened = nullptr) {
  const Eigen::VectorXd truth = Eigen::VectorXd::Ones(a.cols());
  int inside = 0;
  for (int set = 0; set < sets; ++set) {
    LeastSquares problem = Line(form.prior, a * truth + noise(static_cast<uint32_t>(set)), a);
    problem.block = form.block, problem.cluster = form.cluster;
    const LaplaceFit fit = FitLaplace(problem, truth, options);
    for (Eigen::Index k = 0; k < a.cols(); ++k) {
      inside += std::abs(fit.mode(k) - 1) < 1.96 * std::sqrt(fit.posterior.covariance(k, k));
    }
    if (widened) *widened += fit.inflation > 1;
  }
  return inside / static_cast<double>(sets * a.cols());
}

TEST_CASE("with heavy tails, intervals hold the truth as often as they say") {
  const Prior prior({Prior::Normal(0, 100), Prior::Normal(0, 100)});
  const Eigen::MatrixXd a = Normals(200, 2, 12);
  const LeastSquares form = Line(prior, Eigen::VectorXd::Zero(200), a);
  LaplaceOptions options;
  options.sandwich = false;
  const auto noise = [](uint32_t set) {
    Random random(5, {set});
    Eigen::VectorXd e(200);
    for (double& x : e) x = 0.1 * StudentT(3, random);
    return e;
  };
  CHECK(Coverage(form, a, 300, options, noise) == Approx(0.95).margin(0.025));  // 2.8 sd
}

TEST_CASE("errors that depend on each other widen the posterior as they must") {
  constexpr int kRows = 2000, kCluster = 25;
  const Prior prior({Prior::Normal(0, 100), Prior::Normal(0, 100)});
  Eigen::MatrixXd a(kRows, 2);
  for (int i = 0; i < kRows; ++i) a.row(i) << 1, std::sin(0.01 * i);
  LeastSquares form = Line(prior, Eigen::VectorXd::Zero(kRows), a);
  form.cluster = Numbers(kRows, kCluster);
  LaplaceOptions plain;
  plain.robust = false;
  LaplaceOptions honest = plain;
  plain.sandwich = false;
  // Autoregressive of first order within each cluster, of variance 1.
  const auto dependent = [=](uint32_t set) {
    Random random(6, {set});
    Eigen::VectorXd e(kRows);
    for (int i = 0; i < kRows; ++i)
      e(i) = i % kCluster == 0 ? random.Normal() : 0.8 * e(i - 1) + 0.6 * random.Normal();
    return e;
  };
  CHECK(Coverage(form, a, 600, honest, dependent) == Approx(0.95).margin(0.02));
  CHECK(Coverage(form, a, 300, plain, dependent) < 0.65);
  const auto independent = [=](uint32_t set) -> Eigen::VectorXd {
    return Normals(kRows, 1, 50'000 + set);
  };
  int widened = 0;
  CHECK(Coverage(form, a, 600, honest, independent, &widened) == Approx(0.95).margin(0.02));
  CHECK(widened <= 15);
}

TEST_CASE("the sandwich takes information away where scores scatter, and nowhere else") {
  // Of a cluster's four rows one tells something along e0, all four tell the same along e1.
  constexpr int kClusters = 2000;
  Eigen::MatrixXd scores = Eigen::MatrixXd::Zero(kClusters * 4, 2);
  for (int c = 0; c < kClusters; ++c) {
    const double sign = c % 2 ? 1 : -1;
    for (int i = 0; i < 4; ++i)
      scores.row(4 * c + i) << (i == c % 4 ? 2 * sign : 0), (c % 4 < 2 ? 1 : -1);
  }
  const Eigen::Matrix2d information = scores.transpose() * scores;
  const Sandwich wider = WidenBySandwich(information, scores, Numbers(kClusters * 4, 4));
  CHECK(wider.inflation == Approx(4).epsilon(0.01));  // sum_c (4)^2 / sum_i 1
  CHECK(wider.information(0, 0) == Approx(information(0, 0)).epsilon(0.01));
  CHECK(wider.information(1, 1) == Approx(information(1, 1) / 4).epsilon(0.01));
  // Too few clusters, no information at all: nothing changes.
  CHECK(WidenBySandwich(information, scores.topRows(28), Numbers(28, 4)).inflation == 1);
  const Eigen::Matrix2d none = Eigen::Matrix2d::Zero();
  CHECK(WidenBySandwich(none, Eigen::MatrixXd::Zero(scores.rows(), 2), Numbers(scores.rows(), 4))
            .information == none);
}

// ln p of blocks of k rows, normal or Student's t, the scale at its maximum by search, up to a
// constant of data and tails.
double Profile(const Eigen::VectorXd& errors, int k, double f) {
  const auto at = [&](double log_s) {
    const double s = std::exp(log_s);
    double sum = -static_cast<double>(errors.size()) * log_s;
    for (Eigen::Index i = 0; i < errors.size(); i += k) {
      const double squared = errors.segment(i, k).squaredNorm() / (s * s);
      sum += std::isinf(f)
                 ? -0.5 * squared
                 : std::lgamma((f + k) / 2) - std::lgamma(f / 2) - 0.5 * k * std::log(f / 2) -
                       0.5 * (f + k) * std::log1p(squared / f);
    }
    return sum;
  };
  double best = -12;
  for (const double step : {0.05, 1e-3}) {
    const double middle = best;
    for (double log_s = step == 0.05 ? -12 : middle - 0.05;
         log_s < (step == 0.05 ? 15 : middle + 0.05); log_s += step) {
      if (at(log_s) > at(best)) best = log_s;
    }
  }
  return at(best);
}

TEST_CASE("the likelihood's scale is at its maximum, whatever else is asked in the same batch") {
  const int k = GENERATE(1, 12);
  const double f = GENERATE(2.0, 8.0, std::numeric_limits<double>::infinity());
  const Prior prior({Prior::Normal(0, 1)});
  const Eigen::VectorXd y = Normals(240, 1, 17);
  LeastSquares problem = Fitting(prior, y, [](const Eigen::VectorXd& x) -> Eigen::VectorXd {
    return x(0) > 50 ? Eigen::VectorXd::Constant(240, kNaN)
                     : Eigen::VectorXd::Constant(240, x(0) * x(0) * x(0));
  });
  problem.block = Numbers(240, k);
  const Eigen::VectorXd x = Eigen::VectorXd{{0, 30, 0.1, -2, 60, 12}};
  const Eigen::VectorXd together = LogLikelihood(problem, x.transpose(), f);
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const double alone = LogLikelihood(problem, x.segment(i, 1), f)(0);
    if (i == 4) {
      CHECK(together(i) == -kInfinity);
      CHECK(alone == -kInfinity);
      continue;
    }
    CAPTURE(k, f, x(i));
    CHECK(together(i) == alone);
    CHECK(alone == Approx(Profile((x(i) * x(i) * x(i) - y.array()).matrix(), k, f)).margin(0.02));
  }
}

}  // namespace
}  // namespace plumb
