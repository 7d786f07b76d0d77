#include "robot/residual_kernels.h"

#include <Eigen/Core>
#include <catch2/catch.hpp>
#include <cmath>

#include "robot/residual.h"

namespace plumb::residual_kernels {

TEST_CASE("products are Eigen's, of full matrices and of lower triangles") {
  const int rows = GENERATE(1, 16, 40, 128, 280), columns = GENERATE(1, 37, 288);
  const Eigen::MatrixXd a = Eigen::MatrixXd::Random(rows, columns);
  const Eigen::VectorXf x = Eigen::VectorXf::Random(columns);
  const PackedMatrix packed(a);
  Eigen::VectorXf y(packed.rows());
  Multiply(packed.data(), packed.packs(), columns, x.data(), y.data());
  CHECK((y.head(rows).cast<double>() - a * x.cast<double>()).norm() < 1e-6 * columns);
  CHECK(y.tail(y.size() - rows).isZero());

  const auto n = static_cast<int>(y.size());
  const Eigen::MatrixXd lower = Eigen::MatrixXd::Random(n, n).triangularView<Eigen::Lower>();
  const Eigen::VectorXf z = Eigen::VectorXf::Random(n);
  MultiplyLower(PackedMatrix(lower).data(), packed.packs(), z.data(), y.data());
  CHECK((y.cast<double>() - lower * z.cast<double>()).norm() < 1e-6 * n);
}

TEST_CASE("e to numbers that are not above zero is what it is") {
  constexpr int kPacks = 10'000, kCount = kPacks * Pack::kSize;
  const Eigen::VectorXf x = Eigen::VectorXf::LinSpaced(kCount, -39.9f, 0);
  Eigen::VectorXf exp = x;
  ExpOfNegatives(exp.data(), kPacks);
  CHECK(exp[kCount - 1] == 1);
  const Eigen::ArrayXd truth = x.cast<double>().array().exp();
  CHECK((exp.cast<double>().array() / truth - 1).abs().maxCoeff() < 3e-7);
}

TEST_CASE(
    "far below zero e to it is next to nothing, above it is 1, and neighbours do not matter") {
  Eigen::VectorXf x = Eigen::VectorXf::Constant(Pack::kSize, -1);
  x[0] = -1e9f, x[1] = -40, x[2] = -INFINITY, x[3] = 1e-3f, x[4] = 5;
  ExpOfNegatives(x.data(), 1);
  CHECK((x[0] == x[1] && x[1] == x[2] && x[2] > 0 && x[2] < 1e-17f));
  CHECK((x[3] == 1 && x[4] == 1));
  CHECK(x[5] == Approx(std::exp(-1.0)));
}

}  // namespace plumb::residual_kernels
