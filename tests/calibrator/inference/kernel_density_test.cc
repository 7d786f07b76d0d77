#include "calibrator/inference/kernel_density.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

namespace plumb {
namespace {

TEST_CASE("a kernel density has the samples' moments, wider by the bandwidth, thinned or not") {
  CHECK(Bandwidth(100, 1) == Approx(std::pow(4. / 300, 0.2)));
  Random random(3);
  const Eigen::MatrixXd samples = StandardNormals(2, 2'000, random);
  // Importance weights that move the mean of N(0, I) to (0.5, 0).
  const Eigen::VectorXd weights = (0.5 * samples.row(0).transpose().array()).exp();
  const double effective = weights.sum() * weights.sum() / weights.squaredNorm();
  for (const int most : {5'000, 300}) {
    const GaussianMixture density = KernelDensity(samples, weights, most, random);
    CHECK(static_cast<int>(density.components.size()) <= most);
    const double h = Bandwidth(std::min<double>(effective, most), 2);
    const Gaussian moments = Moments(density);
    const Eigen::VectorXd mean = samples * weights / weights.sum();
    const Eigen::MatrixXd centred = samples.colwise() - mean;
    const Eigen::MatrixXd covariance =
        centred * weights.asDiagonal() * centred.transpose() / weights.sum();
    CHECK((moments.mean - mean).norm() < (most == 300 ? 0.1 : 1e-9));
    CHECK((moments.covariance - (1 + h * h) * covariance).norm() < (most == 300 ? 0.2 : 1e-9));
    double sum = 0;
    for (const double w : density.weights) sum += w;
    CHECK(sum == Approx(1));
  }
  // Systematic: a sample of half the weight is drawn half of the times.
  Eigen::VectorXd heavy = Eigen::VectorXd::Ones(2'000);
  heavy(7) = 1'999;
  const GaussianMixture thinned = KernelDensity(samples, heavy, 100, random);
  CHECK(*std::max_element(thinned.weights.begin(), thinned.weights.end()) ==
        Approx(0.5).margin(0.011));
  CHECK_THROWS_AS(KernelDensity(samples, Eigen::VectorXd::Zero(2'000), 10, random),
                  std::invalid_argument);
}

}  // namespace
}  // namespace plumb
