#include "calibrator/fit/discrepancy.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "calibrator/fit/recorded_window.h"
#include "calibrator/fit/whitening.h"
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

// From the first to the last: Eigen's order depends on where in memory a column begins, hence on
// what is beside it, and a batch may be shared out.
Eigen::VectorXd ColumnSums(const Eigen::MatrixXd& values) {
  Eigen::VectorXd sums(values.cols());
  for (Eigen::Index j = 0; j < values.cols(); ++j)
    sums(j) = std::accumulate(values.col(j).begin(), values.col(j).end(), 0.0);
  return sums;
}

}  // namespace

Discrepancy::Discrepancy(const RobotDescription& robot, ExecutionOptions execution)
    : n_(robot.num_velocities()),
      space_(robot),
      windows_(std::make_shared<Model>(robot), execution.threads),
      scale_(MakeTask(robot)->state_scale()),
      batches_(execution.batches) {}

void Discrepancy::OneStep(std::span<const Rollout> rollouts, std::vector<Window>* windows,
                          Ends* ends) const {
  for (const Rollout& rollout : rollouts) {
    for (size_t i = 0; i < rollout.transitions.size(); ++i) {
      windows->push_back(RecordedWindow(windows_.model(), rollout, i, 1));
      ends->push_back(&rollout.transitions[i]);
    }
  }
}

void Discrepancy::Predict(const Eigen::MatrixXd& parameters, std::span<const Window> windows,
                          const Windows::Visit& visit, bool last_only) {
  const Windows::Failures failures = windows_.Predict(parameters, windows, visit, last_only);
  failures_.impossible += failures.impossible;
  failures_.diverged += failures.diverged;
}

Eigen::VectorXd Discrepancy::LogLikelihood(const Eigen::MatrixXd& parameters,
                                           std::span<const Rollout> rollouts) {
  const Eigen::MatrixXd squared = SquaredStepErrors(parameters, rollouts);
  const double weight = -0.5 * (kDegreesOfFreedom + 2 * static_cast<double>(n_));
  return weight * ColumnSums((squared / kDegreesOfFreedom).array().log1p().matrix());
}

Eigen::VectorXd Discrepancy::StepError(const Eigen::MatrixXd& parameters,
                                       std::span<const Rollout> rollouts) {
  const Eigen::MatrixXd squared = SquaredStepErrors(parameters, rollouts);
  return ColumnSums(squared) / static_cast<double>(squared.rows() * 2 * n_);
}

Eigen::MatrixXd Discrepancy::Residuals(const Eigen::MatrixXd& parameters,
                                       std::span<const Rollout> rollouts) {
  std::vector<Window> windows;
  Ends ends;
  OneStep(rollouts, &windows, &ends);
  const Eigen::Index size = 2 * n_;
  Eigen::MatrixXd residuals(static_cast<Eigen::Index>(windows.size()) * size, parameters.cols());
  Predict(parameters, windows,
          [&](Eigen::Index sample, size_t window, size_t, const auto& q, const auto& v) {
            auto errors =
                residuals.col(sample).segment(static_cast<Eigen::Index>(window) * size, size);
            const Eigen::VectorXd off = space_.Difference(q, ends[window]->next_q);
            for (Eigen::Index i = 0; i < n_; ++i) {
              errors(2 * i) = v(i) - ends[window]->next_v(i);
              errors(2 * i + 1) = off(i);
            }
          });
  const std::array<Eigen::Index, 2> step{0, size};
  std::vector<int> coordinates;  // of a transition's errors
  for (int i = 0; i < static_cast<int>(n_); ++i) {
    coordinates.push_back(static_cast<int>(n_) + i);
    coordinates.push_back(i);
  }
  for (size_t window = 0; window < ends.size(); ++window) {
    const Transition& t = *ends[window];
    const Eigen::MatrixXd free_motion = FreeMotion(n_, t.duration());
    Eigen::MatrixXd sensitivity(size, size);
    Eigen::VectorXd end_sd(size);
    for (Eigen::Index i = 0; i < n_; ++i) {
      sensitivity.row(2 * i) = free_motion.row(n_ + i);
      sensitivity.row(2 * i + 1) = free_motion.row(i);
      end_sd(2 * i) = t.next_v_sd(i);
      end_sd(2 * i + 1) = t.next_q_sd(i);
    }
    auto errors = residuals.middleRows(static_cast<Eigen::Index>(window) * size, size);
    Eigen::VectorXd start_sd = StartSd(t);
    AddDisturbance(t, coordinates, &start_sd, &sensitivity);
    WhitenWindow(step, start_sd, sensitivity, end_sd, errors);
    for (Eigen::Index j = 0; j < errors.cols(); ++j) {
      if (!errors.col(j).allFinite()) errors.col(j).setConstant(kInfinity);
    }
  }
  return residuals;
}

// One row per transition, one column per sample.
Eigen::MatrixXd Discrepancy::SquaredStepErrors(const Eigen::MatrixXd& parameters,
                                               std::span<const Rollout> rollouts) {
  const Eigen::MatrixXd residuals = Residuals(parameters, rollouts);
  const Eigen::Index size = 2 * n_;
  Eigen::MatrixXd squared(residuals.rows() / size, residuals.cols());
  for (Eigen::Index j = 0; j < squared.cols(); ++j) {
    for (Eigen::Index i = 0; i < squared.rows(); ++i) {
      const auto errors = residuals.col(j).segment(i * size, size);
      squared(i, j) = std::inner_product(errors.begin(), errors.end(), errors.begin(), 0.0);
    }
  }
  return squared;
}

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
    const auto& t = rollout.transitions;
    for (size_t start = 0; start + length <= t.size(); ++start) {
      if (t[start + length - 1].step != t[start].step + horizon - 1) continue;
      if (!t[start + length - 1].next_q.array().isFinite().any() &&
          !t[start + length - 1].next_v.array().isFinite().any())
        continue;
      windows.push_back(RecordedWindow(windows_.model(), rollout, start, length));
      ends.push_back(&t[start + length - 1]);
    }
  }
  if (windows.empty())
    return Eigen::VectorXd::Constant(parameters.cols(), std::numeric_limits<double>::quiet_NaN());
  Eigen::MatrixXd squared(static_cast<Eigen::Index>(windows.size()), parameters.cols());
  Predict(
      parameters, windows,
      [&](Eigen::Index sample, size_t window, size_t, const auto& q, const auto& v) {
        const Transition& end = *ends[window];
        Eigen::VectorXd error(2 * n_);
        error << space_.Difference(q, end.next_q), v - end.next_v;
        Eigen::ArrayXd recorded(2 * n_);  // NaN where it is not
        recorded << space_.Difference(end.next_q, end.next_q), end.next_v;
        const auto observed = recorded.isFinite();
        const double mean = observed.select((error.array() / scale_.array()).square(), 0.0).sum() /
                            static_cast<double>(observed.count());
        squared(static_cast<Eigen::Index>(window), sample) = std::isfinite(mean) ? mean : kInfinity;
      });
  return (ColumnSums(squared) / static_cast<double>(squared.rows())).cwiseSqrt();
}

}  // namespace plumb
