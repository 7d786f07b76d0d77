// How far simulators are from the record after more than one step.
#include <algorithm>
#include <cmath>
#include <utility>

#include "calibrator/fit/discrepancy.h"
#include "calibrator/fit/recorded_window.h"
#include "common/hash.h"
#include "common/special_numbers.h"

namespace plumb {
namespace {

constexpr uint64_t kReplay = ~uint64_t{0};  // of a batch; 0 trajectories, others horizons

// Gaussian filter over rows (time), reflected at both ends, the last row included.
Eigen::MatrixXd SmoothOverTime(const Eigen::MatrixXd& x, double sigma_rows) {
  const int n = static_cast<int>(x.rows()), reach = static_cast<int>(std::ceil(4 * sigma_rows));
  if (reach == 0 || n < 2) return x;
  Eigen::MatrixXd smooth = Eigen::MatrixXd::Zero(x.rows(), x.cols());
  double total = 0;
  for (int offset = -reach; offset <= reach; ++offset) {
    const double weight = std::exp(-0.5 * offset * offset / (sigma_rows * sigma_rows));
    total += weight;
    for (int i = 0; i < n; ++i) {
      int from = ((i + offset) % (2 * n) + 2 * n) % (2 * n);
      if (from >= n) from = 2 * n - 1 - from;
      smooth.row(i) += weight * x.row(from);
    }
  }
  return smooth / total;
}

}  // namespace

template <class Compute>
Eigen::VectorXd Discrepancy::Batch(uint64_t identity, const Eigen::MatrixXd& parameters,
                                   const Compute& compute) {
  BatchRunner here;
  return (batches_ ? *batches_ : here)
      .Run(Hash(parameters, identity), 1, parameters.cols(),
           [&](Eigen::Index first, Eigen::Index count) -> Eigen::MatrixXd {
             return compute(parameters.middleCols(first, count)).transpose();
           })
      .transpose();
}

Eigen::VectorXd Discrepancy::TrajectoryError(const Eigen::MatrixXd& parameters,
                                             std::span<const Rollout> rollouts, double smoothing) {
  return Batch(0, parameters, [&](const Eigen::MatrixXd& columns) {
    return TrajectoryErrorHere(columns, rollouts, smoothing);
  });
}

Eigen::VectorXd Discrepancy::PredictionError(const Eigen::MatrixXd& parameters,
                                             std::span<const Rollout> rollouts, int horizon) {
  return Batch(static_cast<uint64_t>(horizon), parameters, [&](const Eigen::MatrixXd& columns) {
    return PredictionErrorHere(columns, rollouts, horizon);
  });
}

Discrepancy::Stretches Discrepancy::WholeStretches(std::span<const Rollout> rollouts) const {
  Stretches all;
  for (const Rollout& rollout : rollouts) {
    const auto& transitions = rollout.transitions;
    for (size_t begin = 0, length = 0; begin < transitions.size(); begin += length) {
      length = StretchLength(rollout, begin);
      all.windows.push_back(RecordedWindow(windows_.model(), rollout, begin, length));
      all.first.push_back(&transitions[begin]);
    }
  }
  return all;
}

Eigen::VectorXd Discrepancy::ReplayError(const Eigen::MatrixXd& parameters,
                                         std::span<const Rollout> rollouts) {
  return Batch(kReplay, parameters,
               [&](const Eigen::MatrixXd& columns) { return ReplayErrorHere(columns, rollouts); });
}

Eigen::VectorXd Discrepancy::ReplayErrorHere(const Eigen::MatrixXd& parameters,
                                             std::span<const Rollout> rollouts) {
  const Stretches stretches = WholeStretches(rollouts);
  const std::vector<Window>& windows = stretches.windows;
  const Ends& first = stretches.first;
  // Of each window, as several threads are visited at once.
  std::vector<Eigen::MatrixXd> squares(windows.size(),
                                       Eigen::MatrixXd::Zero(parameters.cols(), n_)),
      counts = squares;
  Predict(
      parameters, windows,
      [&](Eigen::Index sample, size_t window, size_t step, const auto& q, const auto&) {
        const Transition& transition = first[window][step];
        const Eigen::VectorXd error = space_.Difference(q, transition.next_q);
        for (Eigen::Index i = 0; i < n_; ++i) {
          if (!IsObserved(space_, transition, i)) continue;
          squares[window](sample, i) += std::isfinite(error(i)) ? error(i) * error(i) : kInfinity;
          ++counts[window](sample, i);
        }
      },
      /*last_only=*/false);
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(parameters.cols(), n_), count = sum;
  for (size_t w = 0; w < windows.size(); ++w) sum += squares[w], count += counts[w];
  if (!(count.array() > 0).any()) return Eigen::VectorXd::Constant(parameters.cols(), kNaN);
  return (count.array() > 0).select(sum.array() / count.array(), 0).rowwise().sum();
}

Eigen::VectorXd Discrepancy::TrajectoryErrorHere(const Eigen::MatrixXd& parameters,
                                                 std::span<const Rollout> rollouts,
                                                 double smoothing) {
  // Over a gap nothing is known of the efforts: the simulation sets off again where the record
  // does.
  const Stretches stretches = WholeStretches(rollouts);
  const std::vector<Window>& windows = stretches.windows;
  const Ends& first = stretches.first;
  // where each window's errors go, and where each roll-out's begin
  std::vector<Eigen::Index> rows, begins;
  Eigen::Index steps = 0;
  for (const Window& window : windows)
    rows.push_back(std::exchange(steps, steps + static_cast<Eigen::Index>(window.steps.size())));
  steps = 0;
  for (const Rollout& rollout : rollouts)
    begins.push_back(
        std::exchange(steps, steps + static_cast<Eigen::Index>(rollout.transitions.size())));
  begins.push_back(steps);
  std::vector<Eigen::MatrixXd> errors(static_cast<size_t>(parameters.cols()),
                                      Eigen::MatrixXd(steps, 2 * n_));
  const auto visit = [&](Eigen::Index sample, size_t window, size_t step, const auto& q,
                         const auto& v) {
    const Transition& transition = first[window][step];
    auto row =
        errors[static_cast<size_t>(sample)].row(rows[window] + static_cast<Eigen::Index>(step));
    row << space_.Difference(q, transition.next_q).transpose(), (v - transition.next_v).transpose();
    row.array() /= scale_.transpose().array();
    for (Eigen::Index i = 0; i < 2 * n_; ++i) {  // what was not observed is not compared
      if (!IsObserved(space_, transition, i)) row(i) = 0;
    }
  };
  Predict(parameters, windows, visit, /*last_only=*/false);
  Eigen::VectorXd total = Eigen::VectorXd::Zero(parameters.cols());
  for (Eigen::Index sample = 0; sample < parameters.cols(); ++sample) {
    for (size_t i = 0; i < rollouts.size(); ++i) {
      if (rollouts[i].transitions.empty()) continue;
      const Eigen::MatrixXd own =
          errors[static_cast<size_t>(sample)].middleRows(begins[i], begins[i + 1] - begins[i]);
      const Eigen::MatrixXd smooth =
          SmoothOverTime(own, smoothing / rollouts[i].transitions[0].duration());
      const double error = smooth.cwiseAbs().sum() + smooth.squaredNorm();
      total(sample) += std::isfinite(error) ? error : kInfinity;
    }
  }
  return total / static_cast<double>(steps);
}

Eigen::VectorXd Discrepancy::PredictionErrorHere(const Eigen::MatrixXd& parameters,
                                                 std::span<const Rollout> rollouts, int horizon) {
  std::vector<Window> windows;
  Ends ends;
  const auto length = static_cast<size_t>(horizon);
  for (const Rollout& rollout : rollouts) {
    for (size_t start = 0; start < rollout.transitions.size(); ++start) {
      if (!IsJudged(rollout, start, length)) continue;
      windows.push_back(RecordedWindow(windows_.model(), rollout, start, length));
      ends.push_back(&rollout.transitions[start + length - 1]);
    }
  }
  if (windows.empty()) return Eigen::VectorXd::Constant(parameters.cols(), kNaN);
  Eigen::MatrixXd squared(static_cast<Eigen::Index>(windows.size()), parameters.cols());
  Predict(parameters, windows,
          [&](Eigen::Index sample, size_t window, size_t, const auto& q, const auto& v) {
            squared(static_cast<Eigen::Index>(window), sample) =
                MeanSquaredError(space_, q, v, *ends[window], scale_);
          });
  return (ColumnSums(squared) / static_cast<double>(squared.rows())).cwiseSqrt();
}

}  // namespace plumb
