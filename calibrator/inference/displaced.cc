#include "calibrator/inference/displaced.h"

#include "calibrator/inference/common_axes.h"
#include "common/decompositions.h"

namespace plumb {

Gaussian Displaced(const Gaussian& prior, const Gaussian& posterior,
                   const Eigen::MatrixXd& displacements) {
  const auto identity = [](Eigen::Index n) { return Eigen::MatrixXd::Identity(n, n); };
  // Along axes in which the prior is a standard normal and the posterior's entries are independent:
  const CommonAxes common = FindCommonAxes(prior.covariance, posterior.covariance);
  const Eigen::ArrayXd precision = common.ratios.array().inverse();
  const Eigen::VectorXd offset = common.inverse * (posterior.mean - prior.mean);
  const Eigen::MatrixXd moved = common.inverse * displacements;
  // what the data know by themselves, and where that says they are,
  const Eigen::VectorXd known = (precision - 1).max(0);
  const Eigen::VectorXd estimate =
      (known.array() > 0).select(precision / known.array() * offset.array(), 0.0);
  // and what is left of it, (known^-1 + D D')^-1, by Woodbury's identity, as known may be zero.
  const Eigen::MatrixXd told = known.asDiagonal() * moved;
  const Eigen::LLT<Eigen::MatrixXd> doubt(
      Eigen::MatrixXd(identity(moved.cols()) + moved.transpose() * told));
  const Eigen::MatrixXd left =
      Eigen::MatrixXd(known.asDiagonal()) - told * doubt.solve(told.transpose());
  const Eigen::LLT<Eigen::MatrixXd> sum(Eigen::MatrixXd(left + identity(left.rows())));
  return {prior.mean + common.axes * sum.solve(left * estimate),
          common.axes * sum.solve(common.axes.transpose())};
}

}  // namespace plumb
