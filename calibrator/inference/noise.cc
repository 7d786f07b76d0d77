#include "calibrator/inference/noise.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace plumb {
namespace {

constexpr double kFewRows = 20;          // of a group, for a scale of its own
constexpr double kPriorRows = 20;        // that a known scale is worth
constexpr int kTailIterations = 500;     // at most
constexpr double kTailTolerance = 1e-7;  // of a scale
constexpr double kWorthwhile = 4;        // [nat] that heavier tails must gain
constexpr std::array<double, 5> kDegreesOfFreedom{2, 4, 8, 16, 32};

}  // namespace

NoiseScale::NoiseScale(const Eigen::VectorXd& rows, bool known)
    : known_(known),
      all_rows_(rows.sum()),
      shared_(static_cast<size_t>(rows.size())),
      rows_(Eigen::VectorXd::Zero(rows.size())) {
  // The first of the small groups stands for all of them.
  int pool = -1;
  for (int g = 0; g < static_cast<int>(rows.size()); ++g) {
    const bool small = rows(g) < kFewRows;
    if (small && pool < 0) pool = g;
    shared_[static_cast<size_t>(g)] = small ? pool : g;
    rows_(shared(g)) += rows(g);
  }
}

Eigen::VectorXd NoiseScale::Estimate(const Eigen::VectorXd& squares, double effective,
                                     double surplus) const {
  const double left = std::max(1 - effective / all_rows_, 0.1);
  Eigen::VectorXd scale = Eigen::VectorXd::Ones(rows_.size());
  for (int g = 0; g < static_cast<int>(rows_.size()); ++g) {
    const int from = shared(g);
    if (rows_(from) == 0) continue;  // nothing of it was observed
    // Whoever knows the noise does not know it to be less: smaller errors are correlated ones.
    const double variance =
        known_ ? std::max(1.0, (squares(from) + kPriorRows) / (rows_(from) * left + kPriorRows))
               : squares(from) / (rows_(from) * left * surplus);
    scale(g) = std::max(std::sqrt(variance), kLeast);
  }
  return scale;
}

namespace {

Eigen::VectorXd RowsOf(const std::vector<int>& group) {
  Eigen::VectorXd rows =
      Eigen::VectorXd::Zero(group.empty() ? 0 : *std::max_element(group.begin(), group.end()) + 1);
  for (const int g : group) rows(g) += 1;
  return rows;
}

}  // namespace

Noise::Noise(const std::vector<int>& group, const std::vector<int>& block, bool scale_known,
             double degrees_of_freedom)
    : group_(group),
      block_(block),
      scale_known_(scale_known),
      rule_(RowsOf(group), scale_known),
      degrees_of_freedom_(degrees_of_freedom) {
  groups_ = group.empty() ? 0 : *std::max_element(group.begin(), group.end()) + 1;
  block_size_ = Eigen::VectorXd::Zero(block.empty() ? 0 : block.back() + 1);
  for (const int b : block) block_size_(b) += 1;
  scale_ = Eigen::VectorXd::Ones(groups_);
}

void Noise::Estimate(const Eigen::VectorXd& errors, double effective) {
  const auto update = [&](const Eigen::VectorXd& robust, double surplus) {
    Eigen::VectorXd squares = Eigen::VectorXd::Zero(groups_);
    for (Eigen::Index i = 0; i < errors.size(); ++i) {
      squares(rule_.shared(group_[static_cast<size_t>(i)])) += robust(i) * errors(i) * errors(i);
    }
    scale_ = rule_.Estimate(squares, effective, surplus);
  };
  // From the same beginning whatever the scales were before.
  update(Eigen::VectorXd::Ones(errors.size()), 1);
  if (std::isinf(degrees_of_freedom_)) return;
  // Expectation-maximisation, as weights depend on scales; that of Liu, Rubin & Wu (Biometrika 85,
  // 1998), whose weights have mean one, is many times faster where nothing else is known of the
  // scales.
  for (int i = 0; i < kTailIterations; ++i) {
    const Eigen::VectorXd before = scale_;
    const Eigen::ArrayXd of_block = BlockWeights(errors);
    update(OfRows(of_block), of_block.mean());
    if ((scale_ - before).cwiseAbs().cwiseQuotient(scale_).maxCoeff() < kTailTolerance) break;
  }
}

bool Noise::ChooseTails(const Eigen::VectorXd& errors, double effective) {
  const double before = degrees_of_freedom_;
  if ((scale_.array() <= kLeastScale).any()) return false;  // rounding has no distribution
  degrees_of_freedom_ = std::numeric_limits<double>::infinity();
  Estimate(errors, effective);
  Noise best = *this;
  double best_likelihood = LogLikelihood(errors) + kWorthwhile;
  for (const double f : kDegreesOfFreedom) {
    Noise candidate = *this;
    candidate.degrees_of_freedom_ = f;
    candidate.Estimate(errors, effective);
    const double likelihood = candidate.LogLikelihood(errors);
    if (likelihood <= best_likelihood) continue;
    best_likelihood = likelihood;
    best.degrees_of_freedom_ = f, best.scale_ = candidate.scale_;
  }
  degrees_of_freedom_ = best.degrees_of_freedom_, scale_ = best.scale_;
  return degrees_of_freedom_ != before;
}

Eigen::VectorXd Noise::RowScale() const {
  Eigen::VectorXd scale(static_cast<Eigen::Index>(group_.size()));
  for (size_t i = 0; i < group_.size(); ++i)
    scale(static_cast<Eigen::Index>(i)) = scale_(group_[i]);
  return scale;
}

Eigen::VectorXd Noise::BlockSquares(const Eigen::VectorXd& errors) const {
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(block_size_.size());
  for (Eigen::Index i = 0; i < errors.size(); ++i) {
    const double scaled = errors(i) / scale_(group_[static_cast<size_t>(i)]);
    squares(block_[static_cast<size_t>(i)]) += scaled * scaled;
  }
  return squares;
}

Eigen::ArrayXd Noise::BlockWeights(const Eigen::VectorXd& errors) const {
  return (degrees_of_freedom_ + block_size_.array()) /
         (degrees_of_freedom_ + BlockSquares(errors).array());
}

Eigen::VectorXd Noise::OfRows(const Eigen::ArrayXd& of_block) const {
  Eigen::VectorXd weights(static_cast<Eigen::Index>(block_.size()));
  for (Eigen::Index i = 0; i < weights.size(); ++i)
    weights(i) = of_block(block_[static_cast<size_t>(i)]);
  return weights;
}

Eigen::VectorXd Noise::Weights(const Eigen::VectorXd& errors) const {
  const Eigen::VectorXd plain = RowScale().array().square().inverse();
  return std::isinf(degrees_of_freedom_) ? plain : plain.cwiseProduct(OfRows(BlockWeights(errors)));
}

Eigen::MatrixXd Noise::Information(const Eigen::MatrixXd& jacobian) const {
  Eigen::VectorXd weights = RowScale().array().square().inverse();
  if (std::isfinite(degrees_of_freedom_)) {
    for (Eigen::Index i = 0; i < weights.size(); ++i) {
      const double k = block_size_(block_[static_cast<size_t>(i)]);
      weights(i) *= (degrees_of_freedom_ + k) / (degrees_of_freedom_ + k + 2);
    }
  }
  return jacobian.transpose() * weights.asDiagonal() * jacobian;
}

double Noise::LogLikelihood(const Eigen::VectorXd& errors) const {
  const Eigen::VectorXd squares = BlockSquares(errors);
  double sum = 0;
  for (size_t i = 0; i < group_.size(); ++i) sum -= std::log(scale_(group_[i]));
  // the scale's own prior, as if kPriorRows errors of variance one had been seen
  if (scale_known_) {
    for (int g = 0; g < groups_; ++g) {
      if (rule_.shared(g) == g)
        sum -= kPriorRows * (std::log(scale_(g)) + 0.5 / (scale_(g) * scale_(g)));
    }
  }
  if (std::isinf(degrees_of_freedom_)) return sum - 0.5 * squares.sum();
  const double f = degrees_of_freedom_;
  for (Eigen::Index b = 0; b < squares.size(); ++b) {
    const double k = block_size_(b);
    sum += std::lgamma((f + k) / 2) - std::lgamma(f / 2) - k / 2 * std::log(f / 2) -
           (f + k) / 2 * std::log1p(squares(b) / f);
  }
  return sum;
}

}  // namespace plumb
