#include "calibrator/inference/group_sums.h"

#include <algorithm>

#include "calibrator/inference/noise.h"
#include "common/decompositions.h"

namespace plumb {
namespace {

constexpr int kMaxIterations = 100;
constexpr double kSettled = 1e-12;  // change of the mode, and of the scales relative to them

}  // namespace

GroupSums::GroupSums(int groups, const Eigen::VectorXd& reference)
    : reference_(reference),
      sums_(static_cast<size_t>(groups),
            Eigen::MatrixXd::Zero(reference.size() + 1, reference.size() + 1)),
      rows_(Eigen::VectorXd::Zero(groups)) {}

void GroupSums::Add(std::span<const int> group, const Eigen::MatrixXd& errors,
                    const Eigen::VectorXd& at, double sign) {
  const Eigen::Index n = reference_.size();
  const Eigen::VectorXd offset = reference_ - at;
  Eigen::VectorXd row(1 + n);
  for (size_t i = 0; i < group.size(); ++i) {
    row = errors.row(static_cast<Eigen::Index>(i));
    row(0) += row.tail(n).dot(offset);
    sums_[static_cast<size_t>(group[i])].noalias() += sign * row * row.transpose();
    rows_(group[i]) += sign;
  }
}

GroupSums::Fit GroupSums::Solve(bool scale_known) const {
  const Eigen::Index n = reference_.size();
  const NoiseScale rule(rows_, scale_known);
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(n, n);
  Fit fit;
  Eigen::VectorXd point = Eigen::VectorXd::Unit(1 + n, 0);  // (1, u - reference)
  double effective = 0;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    Eigen::VectorXd squares = Eigen::VectorXd::Zero(rows_.size());
    for (size_t g = 0; g < sums_.size(); ++g) {
      squares(rule.shared(static_cast<int>(g))) += std::max(0.0, point.dot(sums_[g] * point));
    }
    const Eigen::VectorXd scale = rule.Estimate(squares, effective);
    Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(1 + n, 1 + n);
    for (size_t g = 0; g < sums_.size(); ++g)
      sum += sums_[g] / (scale(static_cast<Eigen::Index>(g)) * scale(static_cast<Eigen::Index>(g)));
    fit.information = sum.bottomRightCorner(n, n);
    const Eigen::LLT<Eigen::MatrixXd> precision(Eigen::MatrixXd(fit.information + identity));
    const Eigen::VectorXd step = -precision.solve(sum.col(0).tail(n) + reference_);
    effective = precision.solve(fit.information).trace();
    const bool settled = iteration > 0 &&
                         (step - point.tail(n)).cwiseAbs().maxCoeff() <= kSettled &&
                         ((scale - fit.scale).array().abs() <= kSettled * scale.array()).all();
    point.tail(n) = step;
    fit.scale = scale;
    if (settled) break;
  }
  fit.mode = reference_ + point.tail(n);
  return fit;
}

}  // namespace plumb
