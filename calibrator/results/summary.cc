#include "calibrator/results/summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/decompositions.h"
#include "common/quantile.h"
#include "robot/parameter_distribution.h"

namespace plumb {
namespace {

constexpr uint32_t kStream = 0x53554d4d;  // "SUMM"
constexpr int kDraws = 4000;
constexpr double kRounding = 1e-9;

void Require(bool holds, const std::string& what) {
  if (!holds) throw std::invalid_argument("findings: " + what);
}

void RequireGaussian(const Gaussian& p, Eigen::Index n, const std::string& name) {
  Require(p.mean.size() == n && p.covariance.rows() == n && p.covariance.cols() == n,
          fmt::format("{} is not of {} parameters", name, n));
  Require(p.mean.allFinite() && p.covariance.allFinite(), name + " is not finite");
  Require(Eigen::LLT<Eigen::MatrixXd>(p.covariance).info() == Eigen::Success,
          name + "'s covariance is not positive definite");
}

void RequireFit(const Findings& findings, Eigen::Index n) {
  RequireGaussian(findings.prior, n, "the prior");
  const GaussianMixture& mixture = findings.posterior;
  Require(!mixture.components.empty() && mixture.weights.size() == mixture.components.size(),
          fmt::format("the posterior has {} weights of {} components", mixture.weights.size(),
                      mixture.components.size()));
  double total = 0;
  for (size_t i = 0; i < mixture.components.size(); ++i) {
    Require(mixture.weights[i] > 0, fmt::format("weight {} of the posterior is not positive", i));
    total += mixture.weights[i];
    RequireGaussian(mixture.components[i], n, fmt::format("component {} of the posterior", i));
  }
  Require(std::abs(total - 1) <= kRounding,
          fmt::format("the posterior's weights sum to {}", total));
  const Eigen::MatrixXd& samples = findings.samples;
  Require(samples.cols() == 0 || samples.rows() == n,
          fmt::format("the samples are not of {} parameters", n));
  Require(samples.allFinite(), "the samples are not finite");
}

Eigen::MatrixXd Draw(const Findings& findings, const RobotDescription& robot) {
  Random random(findings.seed, {kStream});
  Eigen::MatrixXd samples(findings.prior.mean.size(), kDraws);
  for (auto column : samples.colwise())
    column = robot.ToPhysical(Sample(findings.posterior, random));
  return samples;
}

}  // namespace

bool Trustworthy(const Findings& findings) {
  return findings.holdout.better && !findings.misspecification.alarm && findings.agreement.agree &&
         findings.efforts.rows == 0 &&
         (DistancesFromPrior(findings).array().abs() <= kContradiction).all();
}

Eigen::VectorXd DistancesFromPrior(const Findings& findings) {
  return (Moments(findings.posterior).mean - findings.prior.mean).array() /
         findings.prior.covariance.diagonal().array().sqrt();
}

std::string Contradiction(const Findings& findings, const RobotDescription& robot) {
  const Eigen::VectorXd distances = DistancesFromPrior(findings);
  std::vector<std::string> far;
  for (Eigen::Index i = 0; i < distances.size(); ++i) {
    if (std::abs(distances(i)) <= kContradiction) continue;
    far.push_back(fmt::format("{} ({:.2g} sd {} than its mean)",
                              robot.parameters[static_cast<size_t>(i)].name, std::abs(distances(i)),
                              distances(i) > 0 ? "more" : "less"));
  }
  if (far.empty()) return {};
  return fmt::format(
      "log and prior contradict each other: {}; are signs and units of the log right, efforts "
      "above all, or was the prior too sure?",
      fmt::join(far, ", "));
}

Summary Summarise(const Findings& findings, const RobotDescription& robot) {
  const auto n = static_cast<Eigen::Index>(robot.parameters.size());
  RequireFit(findings, n);
  Summary summary;
  const ParameterDistribution prior{0, robot.parameters, {{1}, {findings.prior}}};
  summary.prior_mean = prior.Mean(), summary.prior_sd = prior.Sd();

  summary.samples = findings.samples.cols() >= 2 ? findings.samples : Draw(findings, robot);
  const Eigen::MatrixXd& samples = summary.samples;
  summary.mean = samples.rowwise().mean();
  const Eigen::MatrixXd centred = samples.colwise() - summary.mean;
  summary.covariance = centred * centred.transpose() / static_cast<double>(samples.cols() - 1);
  summary.sd = summary.covariance.diagonal().cwiseSqrt();
  summary.lower.resize(n), summary.upper.resize(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    std::vector<double> sorted(samples.row(i).begin(), samples.row(i).end());
    std::sort(sorted.begin(), sorted.end());
    summary.lower(i) = Quantile(sorted, 0.025), summary.upper(i) = Quantile(sorted, 0.975);
  }

  summary.coordinates = Moments(findings.posterior);
  summary.gain = (findings.prior.covariance.diagonal().array() /
                  summary.coordinates.covariance.diagonal().array())
                     .log() /
                 2;
  return summary;
}

}  // namespace plumb
