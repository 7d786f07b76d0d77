#include "calibrator/inference/reps_search.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "common/decompositions.h"

namespace plumb {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// A normal likelihood of three parameters that says nothing of the last.
struct Linear {
  Prior prior{{Prior::Normal(1, 1), Prior::Normal(-2, 0.5), Prior::Normal(3, 2)}};
  Eigen::Vector3d at{1.8, -2.3, 0};
  Eigen::Matrix3d information{{60, 30, 0}, {30, 90, 0}, {0, 0, 0}};

  Eigen::VectorXd operator()(const Eigen::MatrixXd& x) const {
    const Eigen::MatrixXd off = x.colwise() - at;
    return -0.5 * off.cwiseProduct(information * off).colwise().sum().transpose();
  }
  Gaussian Posterior() const {
    const Eigen::Matrix3d precision = Eigen::Vector3d(1, 4, 0.25).asDiagonal();
    const Eigen::Matrix3d covariance = (information + precision).inverse();
    return {covariance * (information * at + precision * Eigen::Vector3d(1, -2, 3)), covariance};
  }
};

TEST_CASE("with log-likelihoods, policy search comes to rest at the posterior") {
  const Linear likelihood;
  const Gaussian truth = likelihood.Posterior();
  const Eigen::Array3d sd = truth.covariance.diagonal().array().sqrt();
  RepsOptions options;
  options.updates = 120;
  const auto check = [&](const RepsRun& run, double mean, double width) {
    CHECK(((run.distribution.mean - truth.mean).array() / sd).abs().maxCoeff() < mean);
    const Eigen::Array3d ratio = run.distribution.covariance.diagonal().array().sqrt() / sd;
    CHECK(ratio.maxCoeff() < 1 + width);
    CHECK(ratio.minCoeff() > 1 - width);
    const double correlation =
        run.distribution.covariance(0, 1) /
        std::sqrt(run.distribution.covariance(0, 0) * run.distribution.covariance(1, 1));
    CHECK(correlation == Approx(truth.covariance(0, 1) / (sd(0) * sd(1))).margin(width));
  };
  for (const uint64_t seed : {1, 2, 3, 4, 5}) {
    options.seed = seed;
    const RepsRun run = RepsSearch(likelihood.prior, likelihood, options);
    check(run, 0.1, 0.2);
    CHECK(run.temperature == 1);
    CHECK(run.simulations == 120 * 25);
    CHECK(run.failures == 0);
  }
  // Without the quadratic model it does so up to the samples' noise, hence with more of them.
  options.surrogate = false;
  options.samples = 400;
  check(RepsSearch(likelihood.prior, likelihood, options), 0.25, 0.2);
}

TEST_CASE("the width at rest is the posterior's even where it is wider than what came before") {
  // A likelihood so flat that the posterior is the prior.
  RepsOptions options;
  options.updates = 60;
  const Prior prior({Prior::Normal(2, 3), Prior::Normal(0, 1)});
  const RepsRun run = RepsSearch(
      prior,
      [](const Eigen::MatrixXd& x) -> Eigen::VectorXd {
        return Eigen::VectorXd::Constant(x.cols(), -7);
      },
      options);
  CHECK((run.distribution.mean - Eigen::Vector2d(2, 0)).norm() < 1e-6);
  CHECK((run.distribution.covariance - Eigen::Matrix2d(Eigen::Vector2d(9, 1).asDiagonal())).norm() <
        1e-6);
  CHECK(run.kl < 1e-9);
}

// The distribution after each update: a shorter search is the beginning of a longer one.
std::vector<Gaussian> Path(const Linear& likelihood, RepsOptions options, int updates) {
  std::vector<Gaussian> path;
  for (options.updates = 0; options.updates <= updates; ++options.updates) {
    path.push_back(RepsSearch(likelihood.prior, likelihood, options).distribution);
  }
  return path;
}

TEST_CASE("no update leads the distribution further than the bound") {
  const Linear likelihood;
  const bool surrogate = GENERATE(false, true);
  RepsOptions options;
  options.surrogate = surrogate;
  const std::vector<Gaussian> path = Path(likelihood, options, 20);
  double sum = 0, farthest = 0;
  for (size_t i = 1; i < path.size(); ++i) {
    const double kl = KlDivergence(path[i], path[i - 1]);
    sum += kl;
    farthest = std::max(farthest, kl);
  }
  CHECK(farthest <= 0.1 * (1 + 1e-9));
  CHECK(farthest > 0.099);  // nor is it more careful than it need be
  options.updates = 20;
  CHECK(RepsSearch(likelihood.prior, likelihood, options).kl == Approx(sum).epsilon(1e-6));
  // Unbound, only the weights' divergence is kept small, and the distribution's is not.
  options.bound_distribution = false;
  const std::vector<Gaussian> free = Path(likelihood, options, 5);
  farthest = 0;
  for (size_t i = 1; i < free.size(); ++i)
    farthest = std::max(farthest, KlDivergence(free[i], free[i - 1]));
  CHECK(farthest > 0.15);
}

Eigen::VectorXd Bowl(const Eigen::MatrixXd& x) {
  return (x.colwise() - Eigen::Vector3d(1.8, -2.3, 2)).colwise().squaredNorm().transpose();
}

TEST_CASE("costs in the unit range are free of units, raw ones are not") {
  const Linear likelihood;
  RepsOptions options;
  options.returns = RepsReturns::kUnitRange;
  options.min_temperature = 0.01;
  const RepsRun run = RepsSearch(likelihood.prior, Bowl, options);
  CHECK((run.distribution.mean - Eigen::Vector3d(1.8, -2.3, 2)).norm() < 0.5);
  CHECK(run.distribution.covariance.trace() < 0.5 * 5.25);
  CHECK(run.weights.sum() == Approx(1));
  const RepsRun other = RepsSearch(
      likelihood.prior,
      [](const Eigen::MatrixXd& x) -> Eigen::VectorXd { return 1e-6 * Bowl(x).array() + 3; },
      options);
  CHECK((run.distribution.mean - other.distribution.mean).norm() < 1e-4);
  // Raw costs far below the least temperature: all samples count alike.
  options.returns = RepsReturns::kRaw;
  const RepsRun tiny = RepsSearch(
      likelihood.prior, [](const Eigen::MatrixXd& x) -> Eigen::VectorXd { return 1e-6 * Bowl(x); },
      options);
  CHECK(tiny.ess == Approx(25).margin(1e-3));
  CHECK(tiny.temperature == 0.01);
  // And of a size that suits the temperature, they do select.
  CHECK((RepsSearch(likelihood.prior, Bowl, options).distribution.mean -
         Eigen::Vector3d(1.8, -2.3, 2))
            .norm() < 0.5);
  options.updates = 1;
  CHECK(RepsSearch(likelihood.prior, Bowl, options).ess < 23);
}

TEST_CASE("as many samples count as asked for") {
  const Linear likelihood;
  RepsOptions options;
  options.kl = 1;
  options.updates = 1;
  const RepsRun sharp = RepsSearch(likelihood.prior, likelihood, options);
  options.least_ess = 18;
  const RepsRun smooth = RepsSearch(likelihood.prior, likelihood, options);
  CHECK(sharp.ess < 15);
  CHECK(smooth.ess >= 18);
  CHECK(smooth.ess < 20);
  CHECK(smooth.temperature > sharp.temperature);
  CHECK(smooth.ess == Approx(1 / smooth.weights.squaredNorm()));
}

TEST_CASE("damping keeps the covariance's shape and scales it as Chebotar does") {
  RepsOptions options;
  options.returns = RepsReturns::kUnitRange;
  options.min_temperature = 0.01;
  options.kl = 0.5;
  options.updates = 1;
  options.bound_distribution = false;
  const Linear likelihood;
  const RepsRun plain = RepsSearch(likelihood.prior, Bowl, options);
  options.damping = 2;
  const RepsRun damped = RepsSearch(likelihood.prior, Bowl, options);
  const Eigen::Matrix3d old = Eigen::Vector3d(1, 0.25, 4).asDiagonal();
  // S' of plain is of the same samples and weights.
  const double m = (old.inverse() * plain.distribution.covariance).trace() / 3;
  CHECK(m < 0.95);
  CHECK((damped.distribution.covariance - std::sqrt(m) * old).norm() < 1e-9);
  CHECK((damped.distribution.mean - plain.distribution.mean).norm() < 1e-12);
  CHECK((plain.distribution.mean - plain.samples * plain.weights).norm() < 1e-12);
}

TEST_CASE("failures are infinitely bad, counted, and teach nothing when they are all there is") {
  const Linear likelihood;
  for (const RepsReturns returns :
       {RepsReturns::kRaw, RepsReturns::kUnitRange, RepsReturns::kLogLikelihood}) {
    RepsOptions options;
    options.returns = returns;
    options.updates = 7;
    const RepsRun none = RepsSearch(
        likelihood.prior,
        [](const Eigen::MatrixXd& x) -> Eigen::VectorXd {
          return Eigen::VectorXd::Constant(x.cols(), std::nan(""));
        },
        options);
    CHECK(none.failures == 7 * 25);
    CHECK(none.distribution.mean == Eigen::Vector3d(1, -2, 3));
    CHECK((none.distribution.covariance - Eigen::Matrix3d(Eigen::Vector3d(1, 0.25, 4).asDiagonal()))
              .norm() < 1e-12);
    CHECK(none.kl == 0);
    // Below zero the first parameter is no simulator; the weights know.
    int64_t expected = 0;
    const RepsRun some = RepsSearch(
        likelihood.prior,
        [&](const Eigen::MatrixXd& x) -> Eigen::VectorXd {
          Eigen::VectorXd values = returns == RepsReturns::kLogLikelihood ? likelihood(x) : Bowl(x);
          for (Eigen::Index i = 0; i < x.cols(); ++i) {
            if (x(0, i) >= 0) continue;
            values(i) = i % 3 == 0 ? std::nan("") : i % 3 == 1 ? kInfinity : -kInfinity;
            ++expected;
          }
          return values;
        },
        options);
    CHECK(expected > 5);
    CHECK(some.failures == expected);
    for (Eigen::Index i = 0; i < some.weights.size(); ++i) {
      if (some.samples(0, i) < 0) CHECK(some.weights(i) == 0);
    }
  }
}

TEST_CASE("the last update's samples and the progress are told") {
  const Linear likelihood;
  RepsOptions options;
  options.updates = 3;
  std::vector<int> told;
  const RepsRun run = RepsSearch(likelihood.prior, likelihood, options,
                                 [&](int update) { told.push_back(update); });
  CHECK(told == std::vector<int>{1, 2, 3});
  CHECK(run.samples.cols() == 25);
  const auto stop = [](int) { throw std::runtime_error("stop"); };
  CHECK_THROWS_AS(RepsSearch(likelihood.prior, likelihood, options, stop), std::runtime_error);
}

}  // namespace
}  // namespace plumb
