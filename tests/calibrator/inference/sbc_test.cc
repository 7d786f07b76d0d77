#include "calibrator/inference/sbc.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <stdexcept>

#include "common/decompositions.h"
#include "common/gaussian.h"

namespace plumb {
namespace {

constexpr int kRuns = 500, kDraws = 99;

// y = A x + noise with sd 1/2, of a normal x: the posterior is known exactly. A does not see x_0 -
// x_1: there the posterior is the prior's.
struct LinearGaussian {
  Prior prior{{Prior::Normal(1, 2), Prior::Normal(-3, 2)}};
  Eigen::MatrixXd a = (Eigen::MatrixXd(3, 2) << 1, 1, -0.5, -0.5, 2, 2).finished();
  double noise = 0.5;

  Gaussian Posterior(const Eigen::VectorXd& truth, Random& random) const {
    const Eigen::VectorXd y = a * truth + noise * StandardNormals(3, 1, random);
    const Eigen::MatrixXd precision =
        Eigen::MatrixXd::Identity(2, 2) / 4 + a.transpose() * a / (noise * noise);
    const Eigen::MatrixXd covariance = Inverse(precision);
    return {covariance * (Eigen::Vector2d(1, -3) / 4 + a.transpose() * y / (noise * noise)),
            covariance};
  }
};

/// A posterior that is wrong: its sd times `width`, its mean moved by `bias` of its sd.
SbcResult Run(double width, double bias, int runs = kRuns, uint64_t seed = 3) {
  const LinearGaussian problem;
  const auto fit = [&](const Eigen::VectorXd& truth,
                       Random& random) -> std::optional<Eigen::MatrixXd> {
    Gaussian posterior = problem.Posterior(truth, random);
    posterior.mean += bias * posterior.covariance.diagonal().cwiseSqrt();
    posterior.covariance *= width * width;
    return Transform(posterior, StandardNormals(2, kDraws, random));
  };
  std::vector<SbcQuantity> quantities = Marginals({"a", "b"});
  quantities.push_back({"a + b, observed", [](const Eigen::VectorXd& x) { return x.sum(); }});
  quantities.push_back({"a - b, unseen", [](const Eigen::VectorXd& x) { return x(0) - x(1); }});
  return RunSbc(problem.prior, fit, quantities, runs, seed);
}

TEST_CASE("an exact posterior is calibrated, along what is observed and what is not") {
  const SbcResult result = Run(1, 0);
  CHECK(result.ranks.rows() == kRuns);
  CHECK(result.draws == kDraws);
  CHECK(result.failures == 0);
  CHECK(result.ranks.minCoeff() >= 0);
  CHECK(result.ranks.maxCoeff() <= kDraws);
  REQUIRE(result.quantities.size() == 4);
  for (const SbcUniformity& quantity : result.quantities) {
    INFO(quantity.name);
    CHECK(quantity.chi2_p > 0.01);
    CHECK(quantity.ecdf_p > 0.01);
    CHECK(quantity.coverage[0] == Approx(0.5).margin(0.07));
    CHECK(quantity.coverage[1] == Approx(0.8).margin(0.06));
    CHECK(quantity.coverage[2] == Approx(0.95).margin(0.03));
  }
  const std::string summary = SbcSummary(result);
  CHECK(summary.find("500 posteriors of 99 draws each; 0 of 500 runs failed") == 0);
  CHECK(summary.find("a - b, unseen") != std::string::npos);
  CHECK(summary.find("too") == std::string::npos);
}

TEST_CASE("posteriors that are too sure or too unsure are found out") {
  const auto check = [](const SbcResult& result, const std::string& verdict) {
    for (const SbcUniformity& quantity : result.quantities) {
      INFO(quantity.name);
      CHECK(quantity.chi2_p < 1e-4);
      CHECK(quantity.ecdf_p < 1e-4);
    }
    CHECK(SbcSummary(result).find(verdict) != std::string::npos);
  };
  const SbcResult sure = Run(0.7, 0), unsure = Run(1.5, 0);
  check(sure, "too sure");
  CHECK(sure.quantities[2].coverage[2] < 0.9);
  check(unsure, "too unsure");
  CHECK(unsure.quantities[2].coverage[0] > 0.6);
}

TEST_CASE("a biased posterior is found out") {
  // A shift of both cancels in a - b, whose posterior stays right.
  for (const double bias : {-0.6, 0.6}) {
    const SbcResult result = Run(1, bias);
    for (size_t i = 0; i < 3; ++i) {
      CHECK(result.quantities[i].chi2_p < 1e-4);
      CHECK(result.quantities[i].ecdf_p < 1e-4);
    }
    CHECK(result.quantities[3].chi2_p > 0.01);
    CHECK(result.quantities[3].ecdf_p > 0.01);
    CHECK(SbcSummary(result).find(bias > 0 ? "too high" : "too low") != std::string::npos);
  }
}

TEST_CASE("p-values of the tests of uniformity are uniform themselves") {
  Random random(11);
  constexpr int kTrials = 400;
  int chi2[2] = {}, ecdf[2] = {};
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<int> ranks(120);
    for (int& rank : ranks) rank = static_cast<int>(random.Uniform() * 20);
    const double p_chi2 = UniformityByChi2(ranks, 19), p_ecdf = UniformityByEcdf(ranks, 19);
    chi2[0] += p_chi2 < 0.05, chi2[1] += p_chi2 < 0.5;
    ecdf[0] += p_ecdf < 0.05, ecdf[1] += p_ecdf < 0.5;
  }
  // Within four standard errors.
  for (const auto& counts : {chi2, ecdf}) {
    CHECK(std::abs(counts[0] - 20) < 18);
    CHECK(std::abs(counts[1] - 200) < 40);
  }
}

TEST_CASE("the test by distribution function is exact where it can be counted") {
  // Two draws of ranks 0 and 1: counts below 1 are 0, 1, 2 with probabilities 1/4, 1/2, 1/4.
  CHECK(UniformityByEcdf({0, 0}, 1) == Approx(0.5));
  CHECK(UniformityByEcdf({0, 1}, 1) == Approx(1));
  // One rank of 0, 1, 2: the extreme ones have tails of 2/3 at one point.
  CHECK(UniformityByEcdf({0}, 2) == Approx(2.0 / 3));
  CHECK(UniformityByEcdf({1}, 2) == Approx(1));
  // All of a hundred ranks in one place.
  CHECK(UniformityByEcdf(std::vector<int>(100, 50), 99) < 1e-12);
}

TEST_CASE("failed runs are counted, and tests are of the others") {
  const LinearGaussian problem;
  int run = 0;
  const auto fit = [&](const Eigen::VectorXd& truth,
                       Random& random) -> std::optional<Eigen::MatrixXd> {
    const Gaussian posterior = problem.Posterior(truth, random);
    Eigen::MatrixXd draws = Transform(posterior, StandardNormals(2, 19, random));
    if (++run % 10 == 0) return std::nullopt;
    if (run % 10 == 1) draws(1, 7) = std::nan("");
    return draws;
  };
  const SbcResult result = RunSbc(problem.prior, fit, Marginals({"a", "b"}), 300, 5);
  CHECK(result.failures == 60);
  CHECK((result.ranks.col(0).array() == SbcResult::kFailed).count() == 60);
  CHECK(result.quantities[0].ecdf_p > 0.01);
  CHECK(SbcSummary(result).find("60 of 300 runs failed (20.0 %)") != std::string::npos);

  const auto never = [](const Eigen::VectorXd&, Random&) -> std::optional<Eigen::MatrixXd> {
    return {};
  };
  const SbcResult nothing = RunSbc(problem.prior, never, Marginals({"a", "b"}), 3, 5);
  CHECK(nothing.failures == 3);
  CHECK(nothing.draws == 0);
  CHECK(std::isnan(nothing.quantities[0].chi2_p));
  CHECK(SbcSummary(nothing).find("unknown") != std::string::npos);
}

TEST_CASE("draws equal to the truth are below it or not, at random") {
  const auto stuck = [](const Eigen::VectorXd& truth, Random&) -> std::optional<Eigen::MatrixXd> {
    return truth.replicate(1, 19).eval();
  };
  const SbcResult result = RunSbc(Prior({Prior::Uniform(0, 1)}), stuck, Marginals({"x"}), 400, 9);
  CHECK(result.quantities[0].chi2_p > 0.01);
  CHECK(result.ranks.maxCoeff() == 19);
  CHECK(result.ranks.minCoeff() == 0);
}

TEST_CASE("runs do not depend on how many there are, and equal seeds give equal ranks") {
  const SbcResult few = Run(1, 0, 5), more = Run(1, 0, 9), other = Run(1, 0, 5, 4);
  CHECK(more.ranks.topRows(5) == few.ranks);
  CHECK(other.ranks != few.ranks);
}

TEST_CASE("what is no calibration is refused") {
  const Prior prior({Prior::Normal(0, 1)});
  int columns = 9;
  const auto growing = [&](const Eigen::VectorXd&, Random&) {
    return std::optional(Eigen::MatrixXd::Zero(1, columns++).eval());
  };
  CHECK_THROWS_AS(RunSbc(prior, growing, Marginals({"x"}), 2, 1), std::invalid_argument);
  CHECK_THROWS_AS(RunSbc(prior, growing, Marginals({"x"}), 0, 1), std::invalid_argument);
  CHECK_THROWS_AS(RunSbc(prior, growing, {}, 1, 1), std::invalid_argument);
  const auto one = [](const Eigen::VectorXd&, Random&) {
    return std::optional(Eigen::MatrixXd::Zero(1, 9).eval());
  };
  const SbcQuantity undefined{"ln x",
                              [](const Eigen::VectorXd& x) { return std::log(-1 - x(0) * x(0)); }};
  CHECK_THROWS_AS(RunSbc(prior, one, {undefined}, 2, 1), std::invalid_argument);
  const auto tall = [](const Eigen::VectorXd&, Random&) {
    return std::optional(Eigen::MatrixXd::Zero(2, 3).eval());
  };
  CHECK_THROWS_AS(RunSbc(prior, tall, Marginals({"x"}), 1, 1), std::invalid_argument);
}

TEST_CASE("of too few posteriors nobody can tell") {
  // All in the middle of 99 draws, with ten tests: of 13 posteriors, p is 0.0014.
  CHECK(FewestPosteriors(99, 10) == 14);
  CHECK(FewestPosteriors(99, 2) < FewestPosteriors(99, 100));
}

}  // namespace
}  // namespace plumb
