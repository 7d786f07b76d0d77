#include "calibrator/fit/one_step.h"

#include <utility>

#include "calibrator/fit/recorded_window.h"

namespace plumb {

OneStep::OneStep(std::shared_ptr<const Model> model, std::span<const Rollout> rollouts, int threads)
    : simulate_(std::move(model), threads), space_(simulate_.model().description()) {
  for (size_t r = 0; r < rollouts.size(); ++r) {
    const auto& transitions = rollouts[r].transitions;
    for (size_t i = 0; i < transitions.size(); ++i) {
      const bool goes_on = i > 0 && transitions[i - 1].step + 1 == transitions[i].step;
      steps_.push_back({static_cast<int>(r), static_cast<int>(i), goes_on, &transitions[i]});
      windows_.push_back(RecordedWindow(simulate_.model(), rollouts[r], i, 1));
    }
  }
}

Eigen::MatrixXd OneStep::Starts() const {
  Eigen::MatrixXd starts(2 * num_velocities(), static_cast<Eigen::Index>(steps_.size()));
  for (size_t i = 0; i < steps_.size(); ++i) {
    const Transition& t = *steps_[i].recorded;
    starts.col(static_cast<Eigen::Index>(i)) << space_.Coordinates(t.q, t.q), t.v;
  }
  return starts;
}

const Eigen::VectorXd& OneStep::EndAbout(size_t k) const {
  if (k + 1 < steps_.size() && steps_[k + 1].goes_on) return steps_[k + 1].recorded->q;
  return NearEnd(*steps_[k].recorded);
}

Eigen::VectorXd OneStep::StartPositions(size_t k, const Eigen::VectorXd& state) const {
  return space_.At(state.head(num_velocities()), steps_[k].recorded->q);
}

Eigen::VectorXd OneStep::EndPositions(size_t k, const Eigen::VectorXd& state) const {
  return space_.At(state.head(num_velocities()), EndAbout(k));
}

Eigen::MatrixXd OneStep::Predict(const Eigen::VectorXd& physical, const Eigen::MatrixXd& starts) {
  for (size_t i = 0; i < windows_.size(); ++i) {
    windows_[i].q = StartPositions(i, starts.col(static_cast<Eigen::Index>(i)));
    windows_[i].v = starts.col(static_cast<Eigen::Index>(i)).tail(num_velocities());
  }
  Eigen::MatrixXd ends(starts.rows(), starts.cols());
  simulate_.Predict(
      physical, windows_, [&](Eigen::Index, size_t window, size_t, const auto& q, const auto& v) {
        ends.col(static_cast<Eigen::Index>(window)) << space_.Coordinates(q, EndAbout(window)), v;
      });
  simulated_steps_ += starts.cols();
  return ends;
}

}  // namespace plumb
