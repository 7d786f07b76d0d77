#include "trainer/conjugate_gradient.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "common/decompositions.h"
#include "common/random.h"

namespace plumb {
namespace {

Eigen::MatrixXd RandomMatrix(int size, uint64_t seed) {
  Random random(seed);
  Eigen::MatrixXd matrix(size, size);
  for (double& value : matrix.reshaped()) value = random.Normal();
  return matrix;
}

auto Product(const Eigen::MatrixXd& matrix) {
  return [&matrix](const Eigen::VectorXd& v, Eigen::VectorXd& av) { av = matrix * v; };
}

TEST_CASE("Agrees with a dense solve") {
  const Eigen::MatrixXd factor = RandomMatrix(20, 1);
  const Eigen::MatrixXd matrix = factor * factor.transpose() + Eigen::MatrixXd::Identity(20, 20);
  const Eigen::VectorXd b = RandomMatrix(20, 2).col(0);
  const LinearSolution solution = ConjugateGradient(Product(matrix), b, 100, 1e-24);
  CHECK(solution.failure.empty());
  CHECK((solution.x - matrix.llt().solve(b)).norm() < 1e-9);
}

TEST_CASE("The residual is b - A x also when stopped early") {
  const Eigen::MatrixXd factor = RandomMatrix(30, 3);
  const Eigen::MatrixXd matrix =
      factor * factor.transpose() + .1 * Eigen::MatrixXd::Identity(30, 30);
  const Eigen::VectorXd b = RandomMatrix(30, 4).col(0);
  const LinearSolution solution = ConjugateGradient(Product(matrix), b, 5, 0);
  CHECK(solution.iterations == 5);
  CHECK((solution.residual - (b - matrix * solution.x)).norm() < 1e-9 * b.norm());
}

TEST_CASE("A negative or non-finite curvature is a failure that says so") {
  const Eigen::MatrixXd negative = -Eigen::MatrixXd::Identity(3, 3);
  CHECK_THAT(ConjugateGradient(Product(negative), Eigen::VectorXd::Ones(3), 5, 1e-10).failure,
             Catch::Contains("curvature"));
  const Eigen::MatrixXd broken = std::nan("") * Eigen::MatrixXd::Ones(3, 3);
  CHECK_THAT(ConjugateGradient(Product(broken), Eigen::VectorXd::Ones(3), 5, 1e-10).failure,
             Catch::Contains("nan"));
  const Eigen::VectorXd infinite =
      Eigen::VectorXd::Constant(3, std::numeric_limits<double>::infinity());
  CHECK_FALSE(ConjugateGradient(Product(negative), infinite, 5, 1e-10).failure.empty());
}

TEST_CASE("Nothing to solve is solved") {
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(3, 3);
  const LinearSolution solution =
      ConjugateGradient(Product(identity), Eigen::VectorXd::Zero(3), 5, 1e-10);
  CHECK(solution.failure.empty());
  CHECK(solution.iterations == 0);
  CHECK(solution.x.isZero());
}

}  // namespace
}  // namespace plumb
