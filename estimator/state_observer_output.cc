// Of state_observer.h: ROBOT_STATE, and ROBOT_STATE_SMOOTHED when it is due.

#include <algorithm>
#include <cmath>

#include "estimator/state_observer.h"

namespace plumb {
namespace {

bool AllFinite(const std::vector<double>& values) {
  return std::all_of(values.begin(), values.end(), [](double x) { return std::isfinite(x); });
}

}  // namespace

void StateObserver::FillState(const joint_state_t& measured, bool restarted) {
  state_.utime = measured.utime;
  state_.sequence = measured.sequence;
  state_.restarted = restarted;
  const bool was_valid = state_.valid;
  state_.valid = since_restart_ >= kSettled;
  for (size_t i = 0; i < joints_.size(); ++i) {
    Joint& joint = joints_[i];
    state_.q[joint.position] = joint.filter.mean()(0);
    state_.v[joint.velocity] = joint.filter.mean()(1);
    state_.q_sd[joint.velocity] = std::sqrt(joint.filter.covariance()(0, 0));
    state_.v_sd[joint.velocity] = std::sqrt(joint.filter.covariance()(1, 1));
    const size_t end = i + 1 < joints_.size() ? joints_[i + 1].velocity : state_.effort.size();
    std::fill(&state_.effort[joint.velocity], state_.effort.data() + end,
              measured.effort_applied[i]);
    if (joint.out) state_.valid = false;
  }
  if (base_) base_->Fill(measured.utime, state_);
  for (const auto* values : {&state_.q, &state_.v, &state_.q_sd, &state_.v_sd})
    state_.valid = state_.valid && AllFinite(*values);
  const auto positions = static_cast<Eigen::Index>(state_.q.size());
  state_.valid = state_.valid && space_.Has(Eigen::VectorXd::Map(state_.q.data(), positions));
  if (state_.valid != was_valid) ++reasons_changed_;
  contact_.Judge(state_);
  const auto room = static_cast<int>(waiting_.size());
  waiting_[static_cast<size_t>((first_waiting_ + num_waiting_++) % room)] = state_;
  if (num_waiting_ > lag_) EmitSmoothed();
}

void StateObserver::EmitSmoothed() {
  robot_state_t& state = ready_[num_ready_++];
  state = waiting_[static_cast<size_t>(first_waiting_)];
  first_waiting_ = (first_waiting_ + 1) % static_cast<int>(waiting_.size());
  --num_waiting_;
  for (size_t i = 0; i < joints_.size(); ++i) {
    const KinematicFilter::Smoothed smoothed = joints_[i].filter.TakeOldest();
    const bool finite = smoothed.mean.allFinite() && smoothed.covariance.allFinite();
    if (joints_[i].of_base || !finite) continue;  // causal as it was
    const size_t position = joints_[i].position, velocity = joints_[i].velocity;
    state.q[position] = smoothed.mean(0);
    state.v[velocity] = smoothed.mean(1);
    state.q_sd[velocity] = std::sqrt(std::max(0.0, smoothed.covariance(0, 0)));
    state.v_sd[velocity] = std::sqrt(std::max(0.0, smoothed.covariance(1, 1)));
  }
  if (base_) base_->Smooth(state.utime, state);
}

}  // namespace plumb
