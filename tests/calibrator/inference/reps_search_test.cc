#include "calibrator/inference/reps_search.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "common/decompositions.h"
#include "common/special_numbers.h"

namespace plumb {
namespace {

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
  for (const uint64_t seed : {1, 2, 3, 4, 5}) {
    options.seed = seed;
    const RepsState run = SearchByReps(likelihood.prior, likelihood, options, 120);
    CHECK(((run.distribution.mean - truth.mean).array() / sd).abs().maxCoeff() < 0.1);
    const Eigen::Array3d ratio = run.distribution.covariance.diagonal().array().sqrt() / sd;
    CHECK(ratio.maxCoeff() < 1.2);
    CHECK(ratio.minCoeff() > 0.8);
    const double correlation =
        run.distribution.covariance(0, 1) /
        std::sqrt(run.distribution.covariance(0, 0) * run.distribution.covariance(1, 1));
    CHECK(correlation == Approx(truth.covariance(0, 1) / (sd(0) * sd(1))).margin(0.2));
    CHECK(run.temperature == 1);
    CHECK(run.update == 120);
    CHECK(run.failures == 0);
  }
}

TEST_CASE("the width at rest is the posterior's even where it is wider than what came before") {
  // A likelihood so flat that the posterior is the prior.
  const Prior prior({Prior::Normal(2, 3), Prior::Normal(0, 1)});
  const RepsState run = SearchByReps(
      prior,
      [](const Eigen::MatrixXd& x) -> Eigen::VectorXd {
        return Eigen::VectorXd::Constant(x.cols(), -7);
      },
      {}, 60);
  CHECK((run.distribution.mean - Eigen::Vector2d(2, 0)).norm() < 1e-6);
  CHECK((run.distribution.covariance - Eigen::Matrix2d(Eigen::Vector2d(9, 1).asDiagonal())).norm() <
        1e-6);
  CHECK(run.kl < 1e-9);
}

Eigen::VectorXd Bowl(const Eigen::MatrixXd& x) {
  return (x.colwise() - Eigen::Vector3d(1.8, -2.3, 2)).colwise().squaredNorm().transpose();
}

TEST_CASE("no update leads the distribution further than the bound") {
  const Linear likelihood;
  const bool by_likelihood = GENERATE(false, true);
  RepsOptions options;
  if (!by_likelihood) options.returns = RepsReturns::kUnitRange, options.min_temperature = 0.01;
  const Gaussian prior = CentralGaussian(likelihood.prior);
  RepsSearch search(prior, options, {0, prior});
  double sum = 0, farthest = 0;
  for (int update = 0; update < 20; ++update) {
    const Gaussian before = search.state().distribution;
    const Eigen::MatrixXd x = search.Samples();
    search.Update(by_likelihood ? likelihood(x) : Bowl(x));
    const double kl = KlDivergence(search.state().distribution, before);
    sum += kl;
    farthest = std::max(farthest, kl);
  }
  CHECK(farthest <= 0.1 * (1 + 1e-9));
  CHECK(farthest > 0.099);  // nor is it more careful than it need be
  CHECK(search.state().kl == Approx(sum).epsilon(1e-6));
}

TEST_CASE("costs in the unit range are free of units") {
  const Linear likelihood;
  RepsOptions options;
  options.returns = RepsReturns::kUnitRange;
  options.min_temperature = 0.01;
  const RepsState run = SearchByReps(likelihood.prior, Bowl, options, 40);
  CHECK((run.distribution.mean - Eigen::Vector3d(1.8, -2.3, 2)).norm() < 0.5);
  CHECK(run.distribution.covariance.trace() < 0.5 * 5.25);
  CHECK(run.points.size() == 0);
  const RepsState other = SearchByReps(
      likelihood.prior,
      [](const Eigen::MatrixXd& x) -> Eigen::VectorXd { return 1e-6 * Bowl(x).array() + 3; },
      options, 40);
  CHECK((run.distribution.mean - other.distribution.mean).norm() < 1e-4);
}

TEST_CASE("failures are infinitely bad, counted, and teach nothing when they are all there is") {
  const Linear likelihood;
  for (const RepsReturns returns : {RepsReturns::kUnitRange, RepsReturns::kLogLikelihood}) {
    RepsOptions options;
    options.returns = returns;
    const RepsState none = SearchByReps(
        likelihood.prior,
        [](const Eigen::MatrixXd& x) -> Eigen::VectorXd {
          return Eigen::VectorXd::Constant(x.cols(), std::nan(""));
        },
        options, 7);
    CHECK(none.update == 7);
    CHECK(none.failures == 7 * 25);
    CHECK(none.distribution.mean == Eigen::Vector3d(1, -2, 3));
    CHECK((none.distribution.covariance - Eigen::Matrix3d(Eigen::Vector3d(1, 0.25, 4).asDiagonal()))
              .norm() < 1e-12);
    CHECK(none.kl == 0);
    // Below zero the first parameter is no simulator.
    int64_t expected = 0;
    const RepsState some = SearchByReps(
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
        options, 7);
    CHECK(expected > 5);
    CHECK(some.failures == expected);
    for (Eigen::Index i = 0; i < some.densities.size(); ++i) {
      if (some.points(0, i) < 0) CHECK(some.densities(i) == -kInfinity);
    }
  }
}

TEST_CASE("a search goes on from its state to the same bits") {
  const Linear likelihood;
  const Gaussian prior = CentralGaussian(likelihood.prior);
  const RepsState straight = SearchByReps(likelihood.prior, likelihood, {}, 9);
  RepsState state{0, prior};
  for (int update = 0; update < 9; ++update) {
    RepsSearch search(prior, {}, state);
    search.Update(likelihood(search.Samples()));
    state = search.state();
  }
  CHECK(state.distribution.mean == straight.distribution.mean);
  CHECK(state.distribution.covariance == straight.distribution.covariance);
  CHECK(state.points.cols() == 9 * 25);
}

TEST_CASE("the progress is told, and may end the search") {
  const Linear likelihood;
  std::vector<int> told;
  SearchByReps(likelihood.prior, likelihood, {}, 3, [&](int update) { told.push_back(update); });
  CHECK(told == std::vector<int>{1, 2, 3});
  const auto stop = [](int) { throw std::runtime_error("stop"); };
  CHECK_THROWS_AS(SearchByReps(likelihood.prior, likelihood, {}, 3, stop), std::runtime_error);
}

}  // namespace
}  // namespace plumb
