#include "calibrator/inference/kernel_density.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

namespace plumb {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

// How often each is drawn in `draws` systematic draws; weights sum to 1.
VectorXd SystematicCounts(const VectorXd& weights, int draws, Random& random) {
  VectorXd counts = VectorXd::Zero(weights.size());
  const double offset = random.Uniform();
  double reached = 0, drawn = 0;
  for (Index i = 0; i < weights.size(); ++i) {
    reached += weights(i) * draws;
    const double until = i + 1 == weights.size()
                             ? draws
                             : std::clamp(std::ceil(reached - offset), drawn, draws + 0.);
    counts(i) = weights(i) > 0 ? until - drawn : 0;
    drawn += counts(i);
  }
  return counts;
}

}  // namespace

double Bandwidth(double effective, Index n) {
  const double d = static_cast<double>(n);
  return std::pow(4 / (d + 2), 1 / (d + 4)) * std::pow(effective, -1 / (d + 4));
}

GaussianMixture KernelDensity(const MatrixXd& samples, const VectorXd& weights, int max_components,
                              Random& random) {
  const double sum = weights.sum();
  if (samples.cols() == 0 || samples.cols() != weights.size() || !(weights.minCoeff() >= 0) ||
      !(sum > 0) || !std::isfinite(sum) || max_components < 1) {
    throw std::invalid_argument(
        "a kernel density needs samples, weights >= 0 and a component at least");
  }
  VectorXd w = weights / sum;
  std::vector<Index> weighty;
  for (Index i = 0; i < w.size(); ++i) {
    if (w(i) > 0) weighty.push_back(i);
  }
  const MatrixXd x = samples(Eigen::all, weighty);
  w = w(weighty).eval();
  if (!x.allFinite()) throw std::invalid_argument("a kernel density needs samples that are finite");

  const VectorXd mean = x * w;
  const MatrixXd centred = x.colwise() - mean;
  double effective = 1 / w.squaredNorm();
  MatrixXd kernel = centred * w.asDiagonal() * centred.transpose();
  if (w.size() > max_components) {
    w = SystematicCounts(w, max_components, random) / max_components;
    effective = std::min<double>(effective, max_components);
  }
  const double h = Bandwidth(effective, x.rows());
  kernel *= h * h;
  // Samples that all agree somewhere must still leave a density.
  kernel.diagonal().array() += 1e-12 * std::max(kernel.diagonal().maxCoeff(), 1e-12);
  GaussianMixture density;
  for (Index i = 0; i < w.size(); ++i) {
    if (!(w(i) > 0)) continue;
    density.weights.push_back(w(i));
    density.components.push_back({x.col(i), kernel});
  }
  const double kept = w.sum();
  for (double& weight : density.weights) weight /= kept;
  return density;
}

}  // namespace plumb
