#include "calibrator/fit/whitening.h"

#include <cmath>

#include "common/decompositions.h"

namespace plumb {

double WhitenWindow(std::span<const Eigen::Index> steps, const Eigen::VectorXd& start_sd,
                    const Eigen::MatrixXd& sensitivity, const Eigen::VectorXd& end_sd,
                    Eigen::Ref<Eigen::MatrixXd> errors) {
  double log_spread = 0;
  if (sensitivity.size() == 0) {
    for (Eigen::Index i = 0; i < errors.rows(); ++i) {
      errors.row(i) /= end_sd(i);
      log_spread += std::log(end_sd(i));
    }
    return log_spread;
  }
  Eigen::MatrixXd offset = Eigen::MatrixXd::Zero(start_sd.size(), errors.cols());
  Eigen::MatrixXd covariance = start_sd.array().square().matrix().asDiagonal();
  for (size_t step = 0; step + 1 < steps.size(); ++step) {
    const Eigen::Index first = steps[step] - steps.front(), count = steps[step + 1] - steps[step];
    if (count == 0) continue;
    const Eigen::MatrixXd h = sensitivity.middleRows(first, count);
    Eigen::MatrixXd spread = h * covariance * h.transpose();
    for (Eigen::Index i = 0; i < count; ++i) spread(i, i) += end_sd(first + i) * end_sd(first + i);
    const Eigen::LLT<Eigen::MatrixXd> factor(spread);
    auto rows = errors.middleRows(first, count);
    rows -= h * offset;
    factor.matrixL().solveInPlace(rows);
    log_spread += factor.matrixLLT().diagonal().array().log().sum();
    if (step + 2 == steps.size()) break;
    const Eigen::MatrixXd whitened_h = factor.matrixL().solve(h);
    const Eigen::MatrixXd gain = covariance * whitened_h.transpose();
    offset += gain * rows;
    covariance -= gain * gain.transpose();
  }
  return log_spread;
}

Eigen::MatrixXd FreeMotion(Eigen::Index n, double duration) {
  Eigen::MatrixXd sensitivity = Eigen::MatrixXd::Identity(2 * n, 2 * n);
  sensitivity.topRightCorner(n, n).diagonal().setConstant(duration);
  return sensitivity;
}

}  // namespace plumb
