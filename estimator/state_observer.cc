#include "estimator/state_observer.h"

#include <algorithm>
#include <cmath>

namespace plumb {
namespace {

constexpr int64_t kLongestGap = 1'000'000;  // [us]; beyond it nothing is known of the motion in between
constexpr int64_t kEndOfTime = int64_t{1} << 60;  // [us]; in 36 000 years
constexpr int kSettled = 5;                 // measurements after a restart until velocity can be trusted

bool Finite(const std::vector<double>& values) {
  return std::all_of(values.begin(), values.end(), [](double x) { return std::isfinite(x); });
}

}  // namespace

StateObserver::StateObserver(const RobotDescription& robot)
    : n_(robot.num_joints()),
      settings_(robot.estimator),
      filters_(static_cast<size_t>(n_), KinematicFilter(robot.estimator)),
      effort_(static_cast<size_t>(n_), 0),
      unknown_step_(2 * robot.effort_limits().maxCoeff()) {
  const auto n = static_cast<size_t>(n_);
  state_.num_joints = n_;
  for (auto* values : {&state_.q, &state_.v, &state_.q_sd, &state_.v_sd, &state_.effort}) values->resize(n, 0);
}

bool StateObserver::Acceptable(const joint_state_t& measured) const {
  // Times of this epoch only, so that differences cannot overflow.
  return measured.num_joints == n_ && measured.utime >= 0 && measured.utime < kEndOfTime && Finite(measured.position) && Finite(measured.velocity) &&
         !(started_ && measured.utime == state_.utime);
}

bool StateObserver::Displaced(const joint_state_t& measured) const {
  for (size_t i = 0; i < filters_.size(); ++i) {
    if (std::abs(filters_[i].Innovation(measured.position[i])) > settings_.reset_after) return true;
  }
  return false;
}

void StateObserver::Restart(const joint_state_t& measured) {
  while (!waiting_.empty()) EmitSmoothed();
  for (size_t i = 0; i < filters_.size(); ++i) filters_[i].Restart(measured.position[i], measured.velocity[i]);
  since_restart_ = 0;
  if (started_) ++restarts_;
  started_ = true;
}

bool StateObserver::OnJointState(const joint_state_t& measured) {
  if (!Acceptable(measured)) {
    ++refused_;
    return false;
  }
  const int64_t elapsed = measured.utime - state_.utime;
  bool restarted = !started_ || elapsed <= 0 || elapsed > kLongestGap;
  if (!restarted) {
    // A step of any joint's effort may step every joint's acceleration.
    double step = 0;
    for (size_t i = 0; i < filters_.size(); ++i) {
      const double change = measured.effort_applied[i] - effort_[i];
      step = std::hypot(step, std::isfinite(change) ? change : unknown_step_);
    }
    for (KinematicFilter& filter : filters_) filter.Predict(static_cast<double>(elapsed) * 1e-6, step);
    restarted = Displaced(measured);
  }
  if (restarted) {
    Restart(measured);
  } else {
    for (size_t i = 0; i < filters_.size(); ++i) filters_[i].Update(measured.position[i], measured.velocity[i]);
    ++since_restart_;
  }

  state_.utime = measured.utime;
  state_.sequence = measured.sequence;
  state_.restarted = restarted;
  state_.valid = since_restart_ >= kSettled;
  for (size_t i = 0; i < filters_.size(); ++i) {
    const KinematicFilter& filter = filters_[i];
    state_.q[i] = filter.mean()(0);
    state_.v[i] = filter.mean()(1);
    state_.q_sd[i] = std::sqrt(filter.covariance()(0, 0));
    state_.v_sd[i] = std::sqrt(filter.covariance()(1, 1));
    state_.effort[i] = measured.effort_applied[i];
    if (std::isfinite(measured.effort_applied[i])) effort_[i] = measured.effort_applied[i];
    if (!measured.valid[i]) state_.valid = false;
  }
  waiting_.push_back(state_);
  if (static_cast<int>(waiting_.size()) > settings_.lag) EmitSmoothed();
  return true;
}

void StateObserver::EmitSmoothed() {
  robot_state_t state = std::move(waiting_.front());
  waiting_.pop_front();
  for (size_t i = 0; i < filters_.size(); ++i) {
    const KinematicFilter::Smoothed smoothed = filters_[i].TakeOldest();
    state.q[i] = smoothed.mean(0);
    state.v[i] = smoothed.mean(1);
    state.q_sd[i] = std::sqrt(std::max(0.0, smoothed.covariance(0, 0)));
    state.v_sd[i] = std::sqrt(std::max(0.0, smoothed.covariance(1, 1)));
  }
  ready_.push_back(std::move(state));
}

}  // namespace plumb
