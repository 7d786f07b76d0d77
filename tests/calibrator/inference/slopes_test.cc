#include "calibrator/inference/slopes.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "calibrator/inference/laplace.h"
#include "tests/calibrator/inference/least_squares_problem.h"

namespace plumb {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

struct Counted {
  Eigen::Index points = 0;
  Eigen::MatrixXd slopes;
};

// Of f, each row an observation.
template <typename Function>
Counted SlopesOf(const Function& f, const Eigen::VectorXd& u) {
  Counted counted;
  const auto errors = [&](const Eigen::MatrixXd& at) {
    counted.points += at.cols();
    Eigen::MatrixXd all(f(u).size(), at.cols());
    for (Eigen::Index i = 0; i < at.cols(); ++i) all.col(i) = f(Eigen::VectorXd(at.col(i)));
    return all;
  };
  const Eigen::VectorXd at_u = f(u);
  const std::vector<int> block = Numbers(at_u.size());
  counted.slopes = Slopes(errors, u, at_u, block);
  return counted;
}

TEST_CASE("a difference across a jump is no slope") {
  Eigen::MatrixXd a = Normals(30, 2, 1);
  a(17, 1) = 0.8;  // with the jump: what goes against it would count as none
  const Eigen::Vector2d u(0.3, -0.7);
  const double jump = 0.5;
  // to the right of u within the difference, in one row; or to the left; or nowhere near
  const double edge = GENERATE(0.5e-5, -0.5e-5, 0.1);
  const auto f = [&](const Eigen::VectorXd& x) -> Eigen::VectorXd {
    Eigen::VectorXd y = a * x;
    if (x(1) > u(1) + edge) y(17) += jump;
    return y;
  };
  const Counted found = SlopesOf(f, u);
  CHECK((found.slopes - a).cwiseAbs().maxCoeff() < 1e-9);
  // The other side is asked only where there is reason to.
  CHECK(found.points == (edge == 0.5e-5 ? 3 : 2));
}

TEST_CASE("one observation that tells most keeps its slope, to the bit") {
  Eigen::MatrixXd a = Normals(30, 2, 1);
  a(4, 0) = 1e4;  // a parameter that an impact alone tells of
  const Eigen::Vector2d u(0.3, -0.7);
  const auto f = [&](const Eigen::VectorXd& x) -> Eigen::VectorXd {
    return a * x + Eigen::VectorXd::Constant(30, x(0) * x(0));
  };
  const Counted found = SlopesOf(f, u);
  CHECK(found.points == 3);
  const Eigen::VectorXd forward =
      (f(u + kSlopeDifference * Eigen::Vector2d(1, 0)) - f(u)) / kSlopeDifference;
  CHECK(found.slopes.col(0) == forward);
}

TEST_CASE("where one step forward is no simulator, one backward has to do; else nothing is told") {
  const Eigen::Vector2d u(0.3, -0.7);
  const bool backward = GENERATE(true, false);
  const auto f = [&](const Eigen::VectorXd& x) -> Eigen::VectorXd {
    if (x(0) > u(0) || (!backward && x(0) < u(0))) return Eigen::Vector3d::Constant(kNone);
    return Eigen::Vector3d(x(0) + x(1), 2 * x(0), 3 * x(1));
  };
  const Counted found = SlopesOf(f, u);
  const Eigen::Vector3d first = backward ? Eigen::Vector3d(1, 2, 0) : Eigen::Vector3d::Zero();
  CHECK((found.slopes.col(0) - first).norm() < 1e-9);
  CHECK((found.slopes.col(1) - Eigen::Vector3d(1, 0, 3)).norm() < 1e-9);
}

TEST_CASE("central differences do not cross a jump, either, and keep what curvature makes") {
  Eigen::MatrixXd a = Normals(30, 2, 1);
  a(17, 1) = 0.8;
  const Eigen::Vector2d u(0.3, -0.7);
  const double edge = GENERATE(0.5e-5, -0.5e-5, 0.1);
  const auto f = [&](const Eigen::VectorXd& x) -> Eigen::VectorXd {
    Eigen::VectorXd y = a.col(1) * x(1) + a.col(0) * std::pow(x(0) - u(0), 2);
    if (x(1) > u(1) + edge) y(17) += 0.5;
    return y;
  };
  const auto errors = [&](const Eigen::MatrixXd& at) {
    Eigen::MatrixXd all(30, at.cols());
    for (Eigen::Index i = 0; i < at.cols(); ++i) all.col(i) = f(Eigen::VectorXd(at.col(i)));
    return all;
  };
  const std::vector<int> block = Numbers(30);
  const Eigen::MatrixXd found =
      CentralSlopes(errors, u, f(u), block, Slopes(errors, u, f(u), block));
  CHECK(found.col(0).cwiseAbs().maxCoeff() < 1e-9);  // a bottom: forward alone says 1e-5
  CHECK((found.col(1) - a.col(1)).cwiseAbs().maxCoeff() < 1e-9);
}

// A foot that slips if friction is a millionth smaller would tell of it to a millionth.
TEST_CASE("a posterior is no narrower for errors that jump beside its mode") {
  const Prior prior = SomePrior();
  const Eigen::MatrixXd a = Normals(200, 3, 1);
  const Eigen::VectorXd y = a * Eigen::Vector3d(2, -0.5, 0.7) + 0.3 * Normals(200, 1, 2);
  LeastSquares smooth = Line(prior, y, a);
  const LaplaceFit without = FitLaplace(smooth, Eigen::Vector3d(1, -1, 0));
  // 0.3 to 0.9 of the difference beside the mode, where the slopes are taken last
  const double beside = GENERATE(0.3, 0.6, 0.9) * kSlopeDifference;
  const double edge = prior.FromStandard(without.standard.mean.array() + beside)(2);
  LeastSquares jumping = Fitting(prior, y, [=](const Eigen::VectorXd& x) -> Eigen::VectorXd {
    Eigen::VectorXd predicted = a * x;
    if (x(2) > edge) predicted(50) += 0.3;
    return predicted;
  });
  const LaplaceFit with = FitLaplace(jumping, without.mode);
  for (Eigen::Index i = 0; i < 3; ++i) {
    CHECK(std::sqrt(with.posterior.covariance(i, i)) ==
          Approx(std::sqrt(without.posterior.covariance(i, i))).epsilon(0.02));
  }
}

}  // namespace
}  // namespace plumb
