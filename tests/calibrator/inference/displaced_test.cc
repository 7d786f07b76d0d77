#include "calibrator/inference/displaced.h"

#include <Eigen/LU>
#include <catch2/catch.hpp>

namespace plumb {
namespace {

Gaussian Combine(const Gaussian& prior, const Eigen::VectorXd& estimate,
                 const Eigen::MatrixXd& width) {
  const Eigen::MatrixXd covariance = (prior.covariance.inverse() + width.inverse()).inverse();
  return {covariance * (prior.covariance.inverse() * prior.mean + width.inverse() * estimate),
          covariance};
}

void CheckSame(const Gaussian& is, const Gaussian& should, double margin = 1e-10) {
  CHECK((is.mean - should.mean).cwiseAbs().maxCoeff() < margin);
  CHECK((is.covariance - should.covariance).cwiseAbs().maxCoeff() < margin);
}

const Gaussian kPrior{Eigen::Vector3d(1, -2, 0.5), Eigen::Vector3d(4, 0.25, 1).asDiagonal()};
const Eigen::Vector3d kEstimate(3, -1, 0.2);
const Eigen::Matrix3d kWidth{{0.5, 0.1, 0}, {0.1, 0.05, -0.02}, {0, -0.02, 2}};

TEST_CASE("displacements widen what the data say, and the prior is combined with that") {
  const Gaussian posterior = Combine(kPrior, kEstimate, kWidth);
  Eigen::MatrixXd moved(3, 2);
  moved << 1, 0.3, -0.5, 2, 7, 0.1;
  CheckSame(Displaced(kPrior, posterior, moved),
            Combine(kPrior, kEstimate, kWidth + moved * moved.transpose()));
}

TEST_CASE("without displacements the posterior stays") {
  const Gaussian posterior = Combine(kPrior, kEstimate, kWidth);
  CheckSame(Displaced(kPrior, posterior, Eigen::MatrixXd(3, 0)), posterior);
  CheckSame(Displaced(kPrior, posterior, Eigen::MatrixXd::Zero(3, 2)), posterior);
}

TEST_CASE("what may be anywhere is known no less than before it was measured") {
  const Gaussian posterior = Combine(kPrior, kEstimate, kWidth);
  CheckSame(Displaced(kPrior, posterior, 1e6 * Eigen::MatrixXd::Identity(3, 3)), kPrior, 1e-6);
  // one direction alone: the others keep what is known of them
  const Gaussian one = Displaced(kPrior, posterior, 1e6 * Eigen::Vector3d::Unit(2));
  Eigen::Matrix3d known = kWidth;
  known(2, 2) = 1e12;
  CheckSame(one, Combine(kPrior, kEstimate, known), 1e-6);
}

TEST_CASE("a posterior as wide as its prior, or wider, tells nothing there") {
  Gaussian posterior = kPrior;
  posterior.mean(1) = -1.9;
  posterior.covariance(1, 1) = 0.3;  // the prior's: 0.25
  posterior.mean(0) = 2;
  posterior.covariance(0, 0) = 1;
  const Gaussian result = Displaced(kPrior, posterior, Eigen::Vector3d(0.1, 0.2, 0.3));
  CHECK(result.mean(1) == Approx(kPrior.mean(1)));
  CHECK(result.covariance(1, 1) == Approx(0.25));
  CHECK(result.covariance(2, 2) == Approx(1));
  // what the data alone say of the first, from its posterior N(2, 1) and prior N(1, 4)
  const double width = 4. / 3 + 0.01, estimate = 1 + 1 * (4 + 4. / 3) / 4;
  CHECK(result.covariance(0, 0) == Approx(1 / (1 / 4. + 1 / width)));
  CHECK(result.mean(0) == Approx((1 / 4. + estimate / width) / (1 / 4. + 1 / width)));
}

}  // namespace
}  // namespace plumb
