#include "calibrator/fit/discrepancy.h"

#include <array>
#include <memory>
#include <numeric>

#include "calibrator/fit/recorded_window.h"
#include "calibrator/fit/whitening.h"
#include "common/special_numbers.h"

namespace plumb {

Discrepancy::Discrepancy(const RobotDescription& robot, ExecutionOptions execution)
    : n_(robot.num_velocities()),
      space_(robot),
      windows_(std::make_shared<Model>(robot), execution.threads),
      scale_(MakeTask(robot)->state_scale()),
      batches_(execution.batches) {}

// From the first to the last: Eigen's order depends on where in memory a column begins, hence on
// what is beside it, and a batch may be shared out.
Eigen::VectorXd Discrepancy::ColumnSums(const Eigen::MatrixXd& values) {
  Eigen::VectorXd sums(values.cols());
  for (Eigen::Index j = 0; j < values.cols(); ++j)
    sums(j) = std::accumulate(values.col(j).begin(), values.col(j).end(), 0.0);
  return sums;
}

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

}  // namespace plumb
