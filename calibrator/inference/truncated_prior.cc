#include "calibrator/inference/truncated_prior.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "calibrator/inference/chi_squared.h"
#include "common/decompositions.h"

namespace plumb {

TruncatedPrior::TruncatedPrior(const GaussianMixture& region, double outside) {
  if (region.components.empty() || !(outside > 0 && outside < 1)) {
    throw std::invalid_argument(
        "a truncated prior needs a region, and a share outside of it between 0 and 1");
  }
  const Eigen::Index n = region.components[0].mean.size();
  const double scale = ChiSquaredAtTail(static_cast<double>(n), outside);
  double nearest = std::numeric_limits<double>::infinity();
  for (const Gaussian& component : region.components) {
    const Eigen::LLT<Eigen::MatrixXd> factor(Eigen::MatrixXd(scale * component.covariance));
    if (factor.info() != Eigen::Success)
      throw std::invalid_argument("covariance is not positive definite");
    ellipsoids_.push_back({component.mean, factor.matrixL(),
                           factor.matrixL().solve(Eigen::MatrixXd::Identity(n, n)),
                           factor.matrixLLT().diagonal().prod()});
    volume_ += ellipsoids_.back().volume;
    // The Frobenius norm bounds the longest half-axis.
    nearest =
        std::min(nearest, std::max(component.mean.norm() - ellipsoids_.back().root.norm(), 0.));
  }
  least_squared_ = nearest * nearest;
}

int TruncatedPrior::Multiplicity(const Eigen::VectorXd& u) const {
  int count = 0;
  for (const Ellipsoid& e : ellipsoids_) {
    count += (e.inverse_root.triangularView<Eigen::Lower>() * (u - e.centre)).squaredNorm() <= 1;
  }
  return count;
}

Eigen::VectorXd TruncatedPrior::Uniform(Random& random) const {
  const Eigen::Index n = ellipsoids_[0].centre.size();
  for (;;) {
    double left = random.Uniform() * volume_;
    size_t k = 0;
    while (k + 1 < ellipsoids_.size() && left >= ellipsoids_[k].volume)
      left -= ellipsoids_[k++].volume;
    Eigen::VectorXd in_ball = StandardNormals(n, 1, random);
    in_ball *= std::pow(random.Uniform(), 1 / static_cast<double>(n)) / in_ball.norm();
    Eigen::VectorXd u = ellipsoids_[k].root * in_ball + ellipsoids_[k].centre;
    // Where ellipsoids overlap, each would count its points. (At least 1: rounding can put u just
    // outside of its own.)
    if (random.Uniform() * std::max(Multiplicity(u), 1) < 1) return u;
  }
}

std::optional<Eigen::MatrixXd> TruncatedPrior::Sample(Eigen::Index count, Random& random,
                                                      int tries) const {
  const Eigen::Index n = ellipsoids_[0].centre.size();
  const auto from_prior = [&](Eigen::VectorXd& u) {
    u = StandardNormals(n, 1, random);
    return Contains(u);
  };
  const auto from_union = [&](Eigen::VectorXd& u) {
    u = Uniform(random);
    return random.Uniform() < std::exp(0.5 * (least_squared_ - u.squaredNorm()));
  };
  Eigen::VectorXd u(n);
  int of_prior = 0, of_union = 0;
  for (int i = 0; i < tries; ++i) of_prior += from_prior(u);
  for (int i = 0; i < tries && 10 * of_prior < tries; ++i) of_union += from_union(u);
  if (of_prior + of_union == 0) return std::nullopt;

  Eigen::MatrixXd draws(n, count);
  int64_t left = static_cast<int64_t>(tries) * count;
  for (Eigen::Index j = 0; j < count; ++j) {
    while (!(of_prior >= of_union ? from_prior(u) : from_union(u))) {
      if (--left < 0) return std::nullopt;
    }
    draws.col(j) = u;
  }
  return draws;
}

}  // namespace plumb
