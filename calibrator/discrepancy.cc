#include "calibrator/discrepancy.h"

#include <cmath>
#include <limits>

namespace plumb {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Gaussian filter over rows (time) with reflected ends.
Eigen::MatrixXd SmoothOverTime(const Eigen::MatrixXd& x, double sigma_rows) {
  const int n = static_cast<int>(x.rows()), reach = static_cast<int>(std::ceil(4 * sigma_rows));
  if (reach == 0 || n < 2) return x;
  Eigen::MatrixXd smooth = Eigen::MatrixXd::Zero(x.rows(), x.cols());
  double total = 0;
  for (int offset = -reach; offset <= reach; ++offset) {
    const double weight = std::exp(-0.5 * offset * offset / (sigma_rows * sigma_rows));
    total += weight;
    for (int i = 0; i < n; ++i) {
      int from = std::abs(i + offset) % (2 * n);
      if (from >= n) from = 2 * n - 1 - from;
      smooth.row(i) += weight * x.row(from);
    }
  }
  return smooth / total;
}

}  // namespace

size_t CountTransitions(std::span<const Rollout> rollouts) {
  size_t count = 0;
  for (const Rollout& rollout : rollouts) count += rollout.transitions.size();
  return count;
}

Discrepancy::Discrepancy(const RobotDescription& robot)
    : n_(robot.num_joints()), simulator_(robot), scale_(MakeTask(robot)->state_scale()) {}

double Discrepancy::StepOnce(const Transition& t, double* whitened) {
  simulator_.SetState(t.q, t.v);
  simulator_.Step(t.efforts);
  if (!simulator_.finite()) return kInfinity;
  const double period = t.duration();
  double squared = 0;
  for (int i = 0; i < n_; ++i) {
    const double error_q = simulator_.q()(i) - t.next_q(i), error_v = simulator_.v()(i) - t.next_v(i);
    const double v_variance = t.v_sd(i) * t.v_sd(i);
    const double qq = t.next_q_sd(i) * t.next_q_sd(i) + t.q_sd(i) * t.q_sd(i) + period * period * v_variance;
    const double vv = t.next_v_sd(i) * t.next_v_sd(i) + v_variance, qv = period * v_variance;
    // Cholesky's factor of [[vv, qv], [qv, qq]], applied from the left.
    const double root_v = std::sqrt(vv);
    const double first = error_v / root_v;
    const double second = (error_q - qv / vv * error_v) / std::sqrt(qq - qv * qv / vv);
    if (whitened) {
      whitened[2 * i] = first;
      whitened[2 * i + 1] = second;
    }
    squared += first * first + second * second;
  }
  return std::isfinite(squared) ? squared : kInfinity;
}

double Discrepancy::LogLikelihood(const Eigen::VectorXd& parameters, std::span<const Rollout> rollouts) {
  simulator_.SetParameters(parameters);
  double sum = 0;
  for (const Rollout& rollout : rollouts) {
    for (const Transition& transition : rollout.transitions) {
      sum += std::log1p(StepOnce(transition, nullptr) / kDegreesOfFreedom);
    }
  }
  return -0.5 * (kDegreesOfFreedom + 2 * n_) * sum;
}

double Discrepancy::StepError(const Eigen::VectorXd& parameters, std::span<const Rollout> rollouts) {
  simulator_.SetParameters(parameters);
  double squared = 0;
  for (const Rollout& rollout : rollouts) {
    for (const Transition& transition : rollout.transitions) squared += StepOnce(transition, nullptr);
  }
  return squared / static_cast<double>(CountTransitions(rollouts) * 2 * static_cast<size_t>(n_));
}

Eigen::VectorXd Discrepancy::Residuals(const Eigen::VectorXd& parameters, std::span<const Rollout> rollouts) {
  simulator_.SetParameters(parameters);
  Eigen::VectorXd residuals(static_cast<Eigen::Index>(CountTransitions(rollouts)) * 2 * n_);
  double* next = residuals.data();
  for (const Rollout& rollout : rollouts) {
    for (const Transition& transition : rollout.transitions) {
      if (StepOnce(transition, next) == kInfinity) std::fill_n(next, 2 * n_, kInfinity);
      next += 2 * n_;
    }
  }
  return residuals;
}

double Discrepancy::TrajectoryError(const Eigen::VectorXd& parameters, std::span<const Rollout> rollouts,
                                    double smoothing) {
  simulator_.SetParameters(parameters);
  double total = 0;
  size_t steps = 0;
  for (const Rollout& rollout : rollouts) {
    if (rollout.transitions.empty()) continue;
    const auto& transitions = rollout.transitions;
    Eigen::MatrixXd errors(static_cast<Eigen::Index>(transitions.size()), 2 * n_);
    simulator_.SetState(transitions[0].q, transitions[0].v);
    Eigen::Index row = 0;
    for (const Transition& t : transitions) {
      // Over a gap nothing is known of the efforts: the simulation sets off again where the record does.
      if (row > 0 && t.step != transitions[static_cast<size_t>(row - 1)].step + 1) simulator_.SetState(t.q, t.v);
      simulator_.Step(t.efforts);
      if (!simulator_.finite()) return kInfinity;
      errors.row(row) << (simulator_.q() - t.next_q).transpose(), (simulator_.v() - t.next_v).transpose();
      errors.row(row).array() /= scale_.transpose().array();
      ++row;
    }
    errors = SmoothOverTime(errors, smoothing / transitions[0].duration());
    total += errors.cwiseAbs().sum() + errors.squaredNorm();
    steps += transitions.size();
  }
  return total / static_cast<double>(steps);
}

double Discrepancy::PredictionError(const Eigen::VectorXd& parameters, std::span<const Rollout> rollouts,
                                    int horizon) {
  simulator_.SetParameters(parameters);
  double squared = 0;
  size_t windows = 0;
  const auto length = static_cast<size_t>(horizon);
  for (const Rollout& rollout : rollouts) {
    const auto& t = rollout.transitions;
    for (size_t start = 0; start + length <= t.size(); ++start) {
      if (t[start + length - 1].step != t[start].step + horizon - 1) continue;
      simulator_.SetState(t[start].q, t[start].v);
      for (size_t i = start; i < start + length; ++i) simulator_.Step(t[i].efforts);
      const Transition& end = t[start + length - 1];
      Eigen::VectorXd error(2 * n_);
      error << simulator_.q() - end.next_q, simulator_.v() - end.next_v;
      squared += (error.array() / scale_.array()).square().mean();
      ++windows;
    }
  }
  if (windows == 0) return std::numeric_limits<double>::quiet_NaN();
  return std::sqrt(squared / static_cast<double>(windows));
}

}  // namespace plumb
