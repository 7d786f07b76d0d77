#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "calibrator/inference/laplace.h"
#include "calibrator/inference/prior.h"
#include "common/gaussian.h"
#include "common/random.h"

namespace plumb {

/// 0, 1, 2, ..., each `divisor` times.
inline std::vector<int> Numbers(Eigen::Index count, int divisor = 1) {
  std::vector<int> numbers;
  for (int i = 0; i < count; ++i) numbers.push_back(i / divisor);
  return numbers;
}

/// Errors f(x) - y, one noise scale, each row an observation and a cluster of its own.
template <typename Model>
LeastSquares Fitting(const Prior& prior, const Eigen::VectorXd& y, const Model& model) {
  return {prior,
          [=](const Eigen::MatrixXd& x) {
            Eigen::MatrixXd errors(y.size(), x.cols());
            for (Eigen::Index j = 0; j < x.cols(); ++j)
              errors.col(j) = model(Eigen::VectorXd(x.col(j))) - y;
            return errors;
          },
          std::vector<int>(static_cast<size_t>(y.size()), 0), Numbers(y.size()), Numbers(y.size())};
}

/// The same of errors a x - y.
inline LeastSquares Line(const Prior& prior, const Eigen::VectorXd& y, const Eigen::MatrixXd& a) {
  return Fitting(prior, y, [a](const Eigen::VectorXd& x) -> Eigen::VectorXd { return a * x; });
}

/// Standard normals, others for each stream.
inline Eigen::MatrixXd Normals(Eigen::Index rows, Eigen::Index columns, uint32_t stream) {
  Random random(29, {stream});
  return StandardNormals(rows, columns, random);
}

/// A normal prior of three parameters.
inline Prior SomePrior() {
  return Prior({Prior::Normal(1, 2), Prior::Normal(-1, 0.5), Prior::Normal(0, 1)});
}

}  // namespace plumb
