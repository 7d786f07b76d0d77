#include "calibrator/inference/importance.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "calibrator/inference/common_axes.h"
#include "calibrator/inference/gaussian_mixture.h"

namespace plumb {
namespace {

// Variance of the wide half, relative to the narrow one; and where the density is rough, so that
// widths that are a single peak's are left behind.
constexpr double kWide = 4, kWider = 100;
constexpr double kLeastWeight = 1e-3;
constexpr double kDoubt = 0.5;  // about the guess's weights

// With variances, along the axes that it shares with the bound, of `least` to `most` times the
// bound's.
Eigen::MatrixXd Limited(const Eigen::MatrixXd& covariance, const Eigen::MatrixXd& bound,
                        double least, double most) {
  const CommonAxes common = FindCommonAxes(bound, covariance);
  return common.axes * common.ratios.cwiseMax(least).cwiseMin(most).asDiagonal() *
         common.axes.transpose();
}
Eigen::MatrixXd AtLeast(const Eigen::MatrixXd& bound, const Eigen::MatrixXd& covariance) {
  return Limited(covariance, bound, 1, std::numeric_limits<double>::infinity());
}
Eigen::MatrixXd AtMost(const Eigen::MatrixXd& bound, const Eigen::MatrixXd& covariance) {
  return Limited(covariance, bound, 0, 1);
}

// Each component as it is, and wide, but no wider than `widest`, if that is given. @param doubt
// share of the draws that go to all components alike.
GaussianMixture Proposal(const GaussianMixture& mixture, double doubt, double wide,
                         const Eigen::MatrixXd& widest) {
  GaussianMixture proposal;
  const double alike = doubt / static_cast<double>(mixture.components.size());
  for (size_t i = 0; i < mixture.components.size(); ++i) {
    for (const double factor : {1.0, wide}) {
      proposal.weights.push_back(((1 - doubt) * mixture.weights[i] + alike) / 2);
      const Eigen::MatrixXd covariance = factor * mixture.components[i].covariance;
      proposal.components.push_back({mixture.components[i].mean,
                                     widest.size() > 0 ? AtMost(widest, covariance) : covariance});
    }
  }
  return proposal;
}

// One step of expectation-maximisation on weighted samples. @param narrower whether a component may
// become so. @param widest that one may become, if that is given.
GaussianMixture Adapt(const GaussianMixture& mixture, const Eigen::MatrixXd& x,
                      const Eigen::VectorXd& weights, bool narrower,
                      const Eigen::MatrixXd& widest) {
  const Eigen::MatrixXd joint = ComponentLogDensities(mixture, x);
  const Eigen::MatrixXd share = (joint.colwise() - LogSumExp(joint)).array().exp();
  const Eigen::Index n = x.rows();
  GaussianMixture adapted;
  for (Eigen::Index k = 0; k < share.cols(); ++k) {
    const Gaussian& old = mixture.components[static_cast<size_t>(k)];
    const Eigen::VectorXd w = weights.cwiseProduct(share.col(k));
    const double total = w.sum();
    if (!(total > kLeastWeight)) continue;
    Gaussian p;
    p.mean = x * w / total;
    const Eigen::MatrixXd centred = x.colwise() - p.mean;
    const double ess = total * total / w.squaredNorm();
    const double d = static_cast<double>(n);
    // Fewer samples have no covariance: a round that has found next to nothing would make the next
    // ones, and the result, surer and surer of it.
    p.covariance = ess < d + 1 ? old.covariance
                               : (ess * (centred * (w / total).asDiagonal() * centred.transpose()) +
                                  d * old.covariance) /
                                     (ess + d);
    if (!narrower) p.covariance = AtLeast(old.covariance, p.covariance);
    if (widest.size() > 0) p.covariance = AtMost(widest, p.covariance);
    adapted.weights.push_back(total);
    adapted.components.push_back(std::move(p));
  }
  double sum = 0;
  for (const double w : adapted.weights) sum += w;
  for (double& w : adapted.weights) w /= sum;
  return adapted;
}

Eigen::VectorXd Normalised(const Eigen::VectorXd& log_weights) {
  const double top = log_weights.maxCoeff();
  if (!std::isfinite(top))
    throw std::invalid_argument("no sample of the proposal can be explained at all");
  // Eigen's vectorised exp(-infinity) is tiny, not zero.
  const Eigen::VectorXd weights =
      log_weights.array().isFinite().select((log_weights.array() - top).exp(), 0.0);
  return weights / weights.sum();
}

double Ess(const Eigen::VectorXd& weights) { return 1 / weights.squaredNorm(); }

// The greatest power of up to 1, to 1 in 1000, with which so many samples count, if any does.
double PowerFor(double least_ess, const Eigen::VectorXd& log_weights) {
  if (Ess(Normalised(log_weights)) >= least_ess) return 1;
  double low = 0, high = 1;
  while (high - low > 1e-3 * high && high > 1e-9) {
    const double middle = (low + high) / 2;
    (Ess(Normalised(middle * log_weights)) >= least_ess ? low : high) = middle;
  }
  return high;
}

}  // namespace

ImportanceFit FitByImportance(
    const std::function<Eigen::VectorXd(const Eigen::MatrixXd&)>& log_density,
    const GaussianMixture& guess, const ImportanceOptions& options) {
  ImportanceFit fit;
  fit.mixture = guess;
  const Eigen::Index n = guess.components.at(0).mean.size();
  std::vector<GaussianMixture> proposals;
  Eigen::VectorXd target(0);
  fit.samples.resize(n, 0);
  for (int round = 0; round < options.rounds || (fit.power < 1 && round < 2 * options.rounds);
       ++round) {
    const bool rough = round >= options.rounds;
    const Eigen::MatrixXd widest = rough ? options.widest : Eigen::MatrixXd();
    proposals.push_back(
        Proposal(fit.mixture, round == 0 ? kDoubt : 0, rough ? kWider : kWide, widest));
    Random random(options.seed, {0x1390, static_cast<uint32_t>(round)});
    Eigen::MatrixXd fresh(n, options.samples);
    for (Eigen::Index i = 0; i < fresh.cols(); ++i) fresh.col(i) = Sample(proposals.back(), random);
    Eigen::VectorXd density = log_density(fresh);
    for (double& d : density) {
      if (!std::isfinite(d)) d = -std::numeric_limits<double>::infinity();
    }
    fit.samples.conservativeResize(n, fit.samples.cols() + fresh.cols());
    fit.samples.rightCols(fresh.cols()) = fresh;
    target.conservativeResize(target.size() + density.size());
    target.tail(density.size()) = density;
    Eigen::MatrixXd proposed(fit.samples.cols(), static_cast<Eigen::Index>(proposals.size()));
    for (size_t p = 0; p < proposals.size(); ++p) {
      proposed.col(static_cast<Eigen::Index>(p)) = LogDensities(proposals[p], fit.samples);
    }
    const Eigen::VectorXd log_weights = target - LogSumExp(proposed);
    fit.weights = Normalised(log_weights);
    fit.ess = Ess(fit.weights);
    fit.heaviest = fit.weights.maxCoeff();
    fit.power = PowerFor(kLeastEss * static_cast<double>(n + 1), log_weights);
    if (fit.power < 1) fit.weights = Normalised(fit.power * log_weights);
    fit.mixture = Adapt(fit.mixture, fit.samples, fit.weights, fit.power == 1 || !rough, widest);
  }
  return fit;
}

Eigen::MatrixXd Resample(const Eigen::MatrixXd& samples, const Eigen::VectorXd& weights,
                         Eigen::Index count, Random& random) {
  Eigen::MatrixXd drawn(samples.rows(), count);
  double at = random.Uniform() / static_cast<double>(count), below = weights(0);
  Eigen::Index from = 0;
  for (Eigen::Index i = 0; i < count; ++i, at += 1 / static_cast<double>(count)) {
    while (at > below && from + 1 < samples.cols()) below += weights(++from);
    drawn.col(i) = samples.col(from);
  }
  return drawn;
}

}  // namespace plumb
