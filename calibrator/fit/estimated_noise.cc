#include "calibrator/fit/estimated_noise.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace plumb {

Eigen::VectorXd EstimatedNoise(const WindowErrors& errors, const LaplaceFit& fit) {
  return ScaledNoise(errors.EndNoise(), fit);
}

// There is no scale of what was never observed.
Eigen::VectorXd ScaledNoise(Eigen::VectorXd noise, const LaplaceFit& fit) {
  for (Eigen::Index c = 0; c < std::min(noise.size(), fit.scale.size()); ++c)
    noise(c) *= std::max(fit.scale(c), 1e-150);
  return noise;
}

Eigen::VectorXd RootMeanSquares(const WindowErrors& errors, const LaplaceFit& fit) {
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(Eigen::Index{2} * errors.num_velocities()),
                  rows = squares;
  for (Eigen::Index i = 0; i < fit.errors.size(); ++i) {
    const int c = errors.rows()[static_cast<size_t>(i)].coordinate;
    squares(c) += std::pow(fit.errors(i) * fit.scale(c), 2);
    rows(c) += 1;
  }
  return squares.cwiseQuotient(rows.cwiseMax(1)).cwiseSqrt();
}

bool LeavesRounding(const Eigen::VectorXd& noise_sd, const Eigen::VectorXd& units,
                    std::span<const WindowErrors::Row> rows, const Eigen::VectorXd& errors) {
  constexpr double kBeyond = 5, kHardlyAny = 0.01;
  if ((noise_sd.array() > kNegligible * units.array()).any()) return false;
  double beyond = 0;
  for (size_t i = 0; i < rows.size(); ++i) {
    const int c = rows[i].coordinate;
    const double error = std::abs(errors(static_cast<Eigen::Index>(i))) * noise_sd(c);
    beyond += error > kBeyond * kNegligible * units(c);
  }
  return beyond <= kHardlyAny * static_cast<double>(rows.size());
}

}  // namespace plumb
