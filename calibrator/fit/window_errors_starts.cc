// How errors depend on the states that windows begin with, and where they are taken to begin.
#include <algorithm>
#include <cmath>
#include <vector>

#include "calibrator/fit/recorded_window.h"
#include "calibrator/fit/window_errors.h"
#include "common/decompositions.h"
#include "common/hash.h"

namespace plumb {
namespace {

constexpr double kExact = 1e-24;  // variance of what does not move, physical units

}  // namespace

bool WindowErrors::Linearise(const Eigen::VectorXd& physical) {
  if (starts_known()) return true;
  bool good = true;
  for (int round = 0; round < (looks_for_starts_ ? kRounds : 1); ++round) {
    const Eigen::MatrixXd middle = Predict(physical, windows_);
    Eigen::MatrixXd sensitivity = Sensitivity(physical, middle);
    good = sensitivity.allFinite();
    if (!good) sensitivity = FreeMotion();
    for (size_t w = 0; w < windows_.size(); ++w) {
      starts_[w].sensitivity =
          sensitivity.middleRows(first_row_[w], first_row_[w + 1] - first_row_[w]);
    }
    if (looks_for_starts_ && good && round + 1 < kRounds) MoveStarts(middle);
  }
  return good;
}

// Of all rows to the states that windows begin with.
// @param middle their errors with these parameters.
Eigen::MatrixXd WindowErrors::Sensitivity(const Eigen::VectorXd& physical,
                                          const Eigen::MatrixXd& middle) {
  const Eigen::VectorXd differences = StartDifferences(noise_sd_);
  Eigen::MatrixXd sensitivity(middle.rows(), 2 * n_);
  for (Eigen::Index c = 0; c < 2 * n_; ++c) {
    std::vector<Window> moved = windows_;
    const double h = differences(c);
    for (Window& window : moved) MoveStart(space_, c, h, &window);
    sensitivity.col(c) = (Predict(physical, moved, static_cast<uint64_t>(c) + 1) - middle) / h;
  }
  return sensitivity;
}

// Each window's beginning to where its errors, and how far the record may be off, are smallest.
// @param errors with which the windows leave the record now.
void WindowErrors::MoveStarts(const Eigen::MatrixXd& errors) {
  for (size_t w = 0; w < windows_.size(); ++w) {
    Start& start = starts_[w];
    const Eigen::Index first = first_row_[w], count = first_row_[w + 1] - first;
    Eigen::VectorXd precision(count);
    for (Eigen::Index i = 0; i < count; ++i)
      precision(i) = 1 / std::pow(NoiseOf(readings_[static_cast<size_t>(first + i)]), 2);
    const Eigen::VectorXd start_sd = StartSdOf(start);
    const Eigen::VectorXd offset =
        start.offset.size() > 0 ? start.offset : Eigen::VectorXd::Zero(2 * n_).eval();
    const Eigen::MatrixXd weighted = precision.asDiagonal() * start.sensitivity;
    Eigen::MatrixXd curvature = weighted.transpose() * start.sensitivity;
    curvature.diagonal() += start_sd.cwiseAbs2().cwiseMax(kExact).cwiseInverse();
    const Eigen::VectorXd best = curvature.llt().solve(
        weighted.transpose() * (start.sensitivity * offset - errors.col(0).segment(first, count)));
    if (!best.allFinite()) continue;
    Window& window = windows_[w];
    window.q = space_.Move(window.q, (best - offset).head(n_));
    window.v += (best - offset).tail(n_);
    start.offset = best;
    identity_ = Hash(Eigen::MatrixXd(best), identity_);
  }
}

Eigen::MatrixXd WindowErrors::FreeMotion() const {
  Eigen::MatrixXd sensitivity =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(readings_.size()), 2 * n_);
  for (size_t i = 0; i < readings_.size(); ++i) {
    const Row& row = readings_[i];
    const auto at = static_cast<Eigen::Index>(i);
    sensitivity(at, row.coordinate) = 1;
    if (row.coordinate >= n_) continue;
    const auto& steps = step_rows_[static_cast<size_t>(row.window)];
    const auto step = std::upper_bound(steps.begin(), steps.end(), at) - steps.begin();
    sensitivity(at, row.coordinate + n_) = TransitionOf(row).duration() * static_cast<double>(step);
  }
  return sensitivity;
}

}  // namespace plumb
