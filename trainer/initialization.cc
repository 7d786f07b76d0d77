#include "trainer/initialization.h"

#include <algorithm>
#include <cmath>

#include "common/decompositions.h"

namespace plumb {
namespace {

/// Q of the QR decomposition of a matrix of normal deviates, with signs such that R's diagonal is
/// positive: then Q is uniformly distributed (Mezzadri, 2007).
Eigen::MatrixXd RandomOrthogonal(Eigen::Index rows, Eigen::Index columns, Random& random) {
  const Eigen::Index tall = std::max(rows, columns), narrow = std::min(rows, columns);
  Eigen::MatrixXd normal(tall, narrow);
  for (double& value : normal.reshaped()) value = random.Normal();
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(normal);
  Eigen::MatrixXd q = FirstColumns(qr.householderQ(), narrow);
  for (Eigen::Index j = 0; j < narrow; ++j) {
    if (qr.matrixQR()(j, j) < 0) q.col(j) = -q.col(j);
  }
  return rows >= columns ? q : q.transpose();
}

}  // namespace

Eigen::VectorXf OrthogonalParameters(const std::vector<int>& sizes, double output_gain,
                                     Random& random) {
  Eigen::Index count = 0;
  for (size_t l = 1; l < sizes.size(); ++l) count += Eigen::Index{sizes[l - 1] + 1} * sizes[l];
  Eigen::VectorXf parameters = Eigen::VectorXf::Zero(count);
  Eigen::Index next = 0;
  for (size_t l = 1; l < sizes.size(); ++l) {
    const double gain = l + 1 < sizes.size() ? std::sqrt(2.) : output_gain;
    const Eigen::MatrixXd weight = gain * RandomOrthogonal(sizes[l], sizes[l - 1], random);
    parameters.segment(next, weight.size()) = weight.reshaped().cast<float>();
    next += weight.size() + sizes[l];
  }
  return parameters;
}

}  // namespace plumb
