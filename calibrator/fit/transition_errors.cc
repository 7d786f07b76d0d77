#include "calibrator/fit/transition_errors.h"

#include <algorithm>
#include <array>
#include <utility>

#include "calibrator/fit/physical_columns.h"
#include "calibrator/fit/recorded_window.h"
#include "calibrator/fit/robot_least_squares.h"
#include "calibrator/fit/whitening.h"
#include "calibrator/fit/window_errors.h"
#include "calibrator/inference/slopes.h"

namespace plumb {
namespace {

// @param raw errors and slopes of what was observed. @param sensitivity of all entries.
Eigen::MatrixXd WhitenTransition(const Transition& recorded, const std::vector<int>& coordinates,
                                 Eigen::MatrixXd raw, const Eigen::MatrixXd& sensitivity,
                                 const Eigen::VectorXd& noise_sd) {
  Eigen::VectorXd end_sd(raw.rows());
  Eigen::MatrixXd observed(sensitivity.size() > 0 ? raw.rows() : 0, sensitivity.cols());
  for (Eigen::Index i = 0; i < raw.rows(); ++i) {
    const int c = coordinates[static_cast<size_t>(i)];
    end_sd(i) = EndSd(recorded, c, noise_sd);
    if (observed.rows() > 0) observed.row(i) = sensitivity.row(c);
  }
  const std::array<Eigen::Index, 2> step{0, raw.rows()};
  WhitenWindow(step, StartSd(recorded, noise_sd), observed, end_sd, raw);
  return raw;
}

}  // namespace

TransitionErrors::TransitionErrors(std::shared_ptr<const Model> model)
    : windows_(std::move(model), 1),
      prior_(PriorOf(windows_.model().description())),
      space_(windows_.model().description()),
      n_(windows_.model().num_velocities()),
      p_(prior_.size()) {}

ObservedTransition TransitionErrors::Observe(std::span<const Rollout> rollouts, size_t rollout,
                                             size_t index) const {
  const Transition& recorded = rollouts[rollout].transitions[index];
  ObservedTransition transition{rollout, index, {}, !(StartSd(recorded).array() == 0).all()};
  for (int c = 0; c < static_cast<int>(2 * n_); ++c) {
    if (IsObserved(space_, recorded, c)) transition.coordinates.push_back(c);
  }
  return transition;
}

// States at the windows' ends, 2 n rows for each window; NaN where the simulation fails.
// @param recorded transitions that they are, each of so many windows one after the other.
Eigen::MatrixXd TransitionErrors::Predict(const Eigen::MatrixXd& standard,
                                          std::span<const Window> windows,
                                          const Recorded& recorded) {
  const size_t each = windows.size() / std::max<size_t>(1, recorded.size());
  const Eigen::MatrixXd physical =
      PhysicalColumns(model().description(), prior_.FromStandard(standard));
  Eigen::MatrixXd ends(2 * n_ * static_cast<Eigen::Index>(windows.size()), physical.cols());
  windows_.Predict(physical, windows,
                   [&](Eigen::Index sample, size_t window, size_t, const auto& q, const auto& v) {
                     const Eigen::Index first = 2 * n_ * static_cast<Eigen::Index>(window);
                     ends.col(sample).segment(first, n_) =
                         space_.Coordinates(q, NearEnd(*recorded[window / each]));
                     ends.col(sample).segment(first + n_, n_) = v;
                   });
  simulated_steps_ += static_cast<int64_t>(windows.size()) * physical.cols();
  return ends;
}

std::vector<Eigen::MatrixXd> TransitionErrors::Linearise(
    std::span<const Rollout> rollouts, std::span<const ObservedTransition* const> transitions,
    const Eigen::VectorXd& at, const Eigen::VectorXd& noise_sd) {
  std::vector<Window> windows;
  Recorded recorded;
  for (const ObservedTransition* transition : transitions) {
    const Rollout& rollout = rollouts[transition->rollout];
    windows.push_back(RecordedWindow(model(), rollout, transition->index, 1));
    recorded.push_back(&rollout.transitions[transition->index]);
  }
  Eigen::MatrixXd points = at.replicate(1, 1 + p_);
  points.rightCols(p_).diagonal().array() += kSlopeDifference;
  const Eigen::MatrixXd ends = Predict(points, windows, recorded);
  const auto sensitivities =
      StartSensitivities(transitions, recorded, windows, at, ends.col(0), noise_sd);
  std::vector<Eigen::MatrixXd> errors(transitions.size());
  for (size_t k = 0; k < transitions.size(); ++k) {
    const std::vector<int>& coordinates = transitions[k]->coordinates;
    const Eigen::Index first = 2 * n_ * static_cast<Eigen::Index>(k);
    if (coordinates.empty() || !ends.col(0).segment(first, 2 * n_).allFinite()) continue;
    Eigen::MatrixXd raw(static_cast<Eigen::Index>(coordinates.size()), 1 + p_);
    const Transition& transition = *recorded[k];
    Eigen::VectorXd reading(2 * n_);
    reading << space_.Coordinates(transition.next_q, NearEnd(transition)), transition.next_v;
    for (Eigen::Index i = 0; i < raw.rows(); ++i) {
      const int c = coordinates[static_cast<size_t>(i)];
      raw.row(i) = ends.row(first + c);
      raw.row(i).tail(p_).array() -= raw(i, 0);
      raw(i, 0) -= reading(c);
    }
    for (Eigen::Index j = 1; j <= p_; ++j) {
      if (raw.col(j).allFinite()) continue;
      // Where one step forward is no simulator, one backward has to do.
      const Eigen::MatrixXd back = Predict(at - kSlopeDifference * Eigen::VectorXd::Unit(p_, j - 1),
                                           {&windows[k], 1}, {recorded[k]});
      for (Eigen::Index i = 0; i < raw.rows(); ++i) {
        const int c = coordinates[static_cast<size_t>(i)];
        raw(i, j) = ends(first + c, 0) - back(c, 0);
      }
      if (!raw.col(j).allFinite()) raw.col(j).setZero();  // nothing can be told of it
    }
    raw.rightCols(p_) /= kSlopeDifference;
    errors[k] =
        WhitenTransition(transition, coordinates, std::move(raw), sensitivities[k], noise_sd);
  }
  return errors;
}

// Sensitivities of the ends to the starts, 2 n x 2 n, of those windows whose start is uncertain;
// by finite differences, or that of free motion where they fail.
// @param middle ends of all windows.
std::vector<Eigen::MatrixXd> TransitionErrors::StartSensitivities(
    std::span<const ObservedTransition* const> transitions, const Recorded& recorded,
    std::span<const Window> windows, const Eigen::VectorXd& at, const Eigen::VectorXd& middle,
    const Eigen::VectorXd& noise_sd) {
  const Eigen::VectorXd differences = StartDifferences(noise_sd);
  std::vector<Window> moved;
  std::vector<size_t> uncertain;
  Recorded moved_of;
  for (size_t k = 0; k < transitions.size(); ++k) {
    if (!transitions[k]->start_uncertain) continue;
    uncertain.push_back(k);
    moved_of.push_back(recorded[k]);
    for (Eigen::Index c = 0; c < 2 * n_; ++c) {
      moved.push_back(windows[k]);
      MoveStart(space_, c, differences(c), &moved.back());
    }
  }
  std::vector<Eigen::MatrixXd> sensitivities(transitions.size());
  if (moved.empty()) return sensitivities;
  const Eigen::MatrixXd ends = Predict(at, moved, moved_of);
  for (size_t u = 0; u < uncertain.size(); ++u) {
    const size_t k = uncertain[u];
    Eigen::MatrixXd sensitivity = Eigen::MatrixXd::Map(
        ends.data() + 4 * n_ * n_ * static_cast<Eigen::Index>(u), 2 * n_, 2 * n_);
    sensitivity.colwise() -= middle.segment(2 * n_ * static_cast<Eigen::Index>(k), 2 * n_);
    sensitivity = sensitivity * differences.cwiseInverse().asDiagonal();
    if (!sensitivity.allFinite()) sensitivity = FreeMotion(n_, recorded[k]->duration());
    sensitivities[k] = std::move(sensitivity);
  }
  return sensitivities;
}

}  // namespace plumb
