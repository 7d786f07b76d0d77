#include "calibrator/diagnostics/log_agreement.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calibrator/inference/chi_squared.h"
#include "common/decompositions.h"

namespace plumb {
namespace {

using Eigen::MatrixXd, Eigen::VectorXd;
using Axes = Eigen::SelfAdjointEigenSolver<MatrixXd>;

// p below which logs are of different robots, or the model is wrong
constexpr double kDisagreement = 1e-3;
// Information in the prior's units: directions with less than the prior has do not count.
constexpr double kTold = 1;
constexpr double kBothTell = 0.99;  // of a product of projectors: 1 in what both determine

MatrixXd PseudoInverse(const Axes& axes) {
  const Eigen::ArrayXd values = axes.eigenvalues().array();
  const VectorXd inverse = (values > kTold).select(1 / values.max(1e-300), 0.0);
  return axes.eigenvectors() * inverse.asDiagonal() * axes.eigenvectors().transpose();
}

MatrixXd Projector(const Axes& axes) {
  const Eigen::Index rank = (axes.eigenvalues().array() > kTold).count();
  const auto v = axes.eigenvectors().rightCols(rank);
  return v * v.transpose();
}

// What logs say without the prior.
struct Likelihood {
  MatrixXd information;
  Axes axes;  // of the information in the prior's units
  VectorXd mode;
};

// @param slope information times mode.
Likelihood Quadratic(const MatrixXd& information, const VectorXd& slope, const VectorXd& prior_sd) {
  const Axes axes(MatrixXd(prior_sd.asDiagonal() * information * prior_sd.asDiagonal()));
  return {information, axes,
          prior_sd.asDiagonal() * PseudoInverse(axes) * prior_sd.asDiagonal() * slope};
}

// Its information times its mode and the prior's times the prior's mean are the posterior's.
Likelihood WithoutPrior(const LaplaceFit& fit, const Gaussian& prior, const VectorXd& prior_sd) {
  const MatrixXd precision = Precision(fit.posterior);
  const VectorXd of_prior = prior_sd.cwiseAbs2().cwiseInverse();
  return Quadratic(precision - MatrixXd(of_prior.asDiagonal()),
                   precision * fit.mode - of_prior.cwiseProduct(prior.mean), prior_sd);
}

LogAgreement Compare(const LogFit& log, const Likelihood& own, const Likelihood& others,
                     const RobotDescription& robot, const VectorXd& prior_sd, size_t logs) {
  LogAgreement result;
  result.log = log.log;
  const VectorXd& mode = log.fit.mode;
  const VectorXd sd = log.fit.posterior.covariance.diagonal().cwiseSqrt();
  result.mean = robot.ToPhysical(mode);
  result.sd = (robot.ToPhysical(mode + sd) - robot.ToPhysical(mode - sd)).cwiseAbs() / 2;

  const MatrixXd told = Projector(own.axes);
  const Axes common(MatrixXd(told * Projector(others.axes) * told));
  const Eigen::Index rank = (common.eigenvalues().array() > kBothTell).count();
  if (rank == 0) {
    result.distance = 0, result.p = 1;
    return result;
  }
  const MatrixXd both = common.eigenvectors().rightCols(rank);
  const VectorXd offset = both.transpose() * (own.mode - others.mode).cwiseQuotient(prior_sd);
  const MatrixXd spread =
      both.transpose() * (PseudoInverse(own.axes) + PseudoInverse(others.axes)) * both;
  const double squared = offset.dot(spread.llt().solve(offset));
  result.distance = std::sqrt(squared);
  result.p =
      std::min(1.0, ChiSquaredTail(static_cast<double>(rank), squared) * static_cast<double>(logs));
  return result;
}

std::string SummaryOf(const Agreement& agreement) {
  if (agreement.agree) return fmt::format("the {} logs agree", agreement.logs.size());
  std::string against;
  for (const LogAgreement& log : agreement.logs) {
    if (log.p < kDisagreement)
      against +=
          fmt::format("{}{} ({:.1f} sd)", against.empty() ? "" : ", ", log.log, log.distance);
  }
  return "the logs do not agree with each other: " + against +
         "; they are of different robots, or the model is wrong in a way that depends on the "
         "motion";
}

}  // namespace

Agreement CompareLogs(const RobotDescription& robot, const Gaussian& prior,
                      std::span<const LogFit> fits) {
  const VectorXd prior_sd = prior.covariance.diagonal().cwiseSqrt();
  std::vector<Likelihood> likelihoods;
  for (const LogFit& log : fits) likelihoods.push_back(WithoutPrior(log.fit, prior, prior_sd));
  Agreement agreement;
  for (size_t i = 0; i < fits.size(); ++i) {
    MatrixXd information = MatrixXd::Zero(prior_sd.size(), prior_sd.size());
    VectorXd slope = VectorXd::Zero(prior_sd.size());
    for (size_t k = 0; k < fits.size(); ++k) {
      if (k == i) continue;
      information += likelihoods[k].information;
      slope += likelihoods[k].information * likelihoods[k].mode;
    }
    agreement.logs.push_back(Compare(fits[i], likelihoods[i],
                                     Quadratic(information, slope, prior_sd), robot, prior_sd,
                                     fits.size()));
  }
  agreement.agree = std::ranges::all_of(
      agreement.logs, [](const LogAgreement& log) { return log.p >= kDisagreement; });
  agreement.summary = fits.size() < 2 ? "fewer than two of the logs can be fitted on their own: "
                                        "nothing to compare"
                                      : SummaryOf(agreement);
  return agreement;
}

}  // namespace plumb
