#pragma once

#include <Eigen/Dense>
#include <limits>

#include "calibrator/inference/problem.h"

namespace plumb {

/// x = t + 0.5 normals, t ~ N(0, 1) in two dimensions, observed at (0.8, -0.4), and a third
/// statistic that nobody observed: the posterior is N(0.8 x, 0.2 I). Simulations whose second
/// parameter exceeds `fails_above` fail.
inline Problem LinearProblem(double fails_above = std::numeric_limits<double>::infinity()) {
  const auto simulate = [fails_above](const Eigen::MatrixXd& parameters, int64_t first) {
    Eigen::MatrixXd outcomes = Eigen::MatrixXd::Zero(3, parameters.cols());
    for (Eigen::Index j = 0; j < parameters.cols(); ++j) {
      Random random(77, {static_cast<uint32_t>(first + j)});
      outcomes.col(j).head(2) = parameters.col(j) + 0.5 * StandardNormals(2, 1, random);
      outcomes(2, j) = 1e6 * random.Normal();
      if (parameters(1, j) > fails_above) outcomes(1, j) = std::numeric_limits<double>::quiet_NaN();
    }
    return outcomes;
  };
  return {Prior({Prior::Normal(0, 1), Prior::Normal(0, 1)}),
          Eigen::Vector3d(0.8, -0.4, std::numeric_limits<double>::quiet_NaN()), simulate};
}

/// Of samples (columns).
inline Gaussian SampleMoments(const Eigen::MatrixXd& samples) {
  Gaussian moments{samples.rowwise().mean(), {}};
  const Eigen::MatrixXd centred = samples.colwise() - moments.mean;
  moments.covariance = centred * centred.transpose() / static_cast<double>(samples.cols());
  return moments;
}

}  // namespace plumb
