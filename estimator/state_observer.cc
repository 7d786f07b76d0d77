#include "estimator/state_observer.h"

#include <algorithm>
#include <cmath>

namespace plumb {
namespace {

constexpr int64_t kLongestGap = 1'000'000;  // [us]; beyond it nothing is known of the motion in between
constexpr int64_t kMostAhead = 10'000;      // [us] of a joint's reading before the others
constexpr int64_t kEndOfTime = int64_t{1} << 60;  // [us]; in 36 000 years
constexpr int kSettled = 5;                 // measurements after a restart until velocity can be trusted

bool Finite(const std::vector<double>& values) {
  return std::all_of(values.begin(), values.end(), [](double x) { return std::isfinite(x); });
}

/// [s] of a joint's measurement.
double Age(const joint_state_t& measured, size_t joint) {
  return static_cast<double>(measured.utime - measured.measured[joint]) * 1e-6;
}

}  // namespace

StateObserver::StateObserver(const RobotDescription& robot)
    : n_(robot.num_joints()),
      settings_(robot.estimator),
      filters_(static_cast<size_t>(n_), KinematicFilter(robot.estimator)),
      measured_(static_cast<size_t>(n_), -1),
      effort_(static_cast<size_t>(n_), 0),
      unknown_step_(2 * robot.effort_limits().maxCoeff()) {
  const auto n = static_cast<size_t>(n_);
  state_.num_joints = n_;
  for (auto* values : {&state_.q, &state_.v, &state_.q_sd, &state_.v_sd, &state_.effort}) values->resize(n, 0);
}

bool StateObserver::Acceptable(const joint_state_t& measured) const {
  // Times of this epoch only, so that differences cannot overflow.
  if (measured.num_joints != n_ || measured.utime < 0 || measured.utime >= kEndOfTime) return false;
  const auto infinite = [](double x) { return std::isinf(x); };  // NaN: not measured
  const auto of_that_time = [&](int64_t t) {
    return t >= 0 && t < kEndOfTime && t - measured.utime <= kMostAhead && measured.utime - t <= kLongestGap;
  };
  return Finite(measured.position) && std::ranges::none_of(measured.velocity, infinite) &&
         std::ranges::all_of(measured.measured, of_that_time) && !(started_ && measured.utime == state_.utime);
}

bool StateObserver::Displaced(const joint_state_t& measured) const {
  for (size_t i = 0; i < filters_.size(); ++i) {
    if (IsNew(measured, i) && std::abs(filters_[i].Innovation(measured.position[i], Age(measured, i))) > settings_.reset_after) return true;
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
    for (size_t i = 0; i < filters_.size(); ++i) {
      if (IsNew(measured, i)) filters_[i].Update(measured.position[i], measured.velocity[i], Age(measured, i));
      else filters_[i].Skip();
    }
    ++since_restart_;
  }
  measured_ = measured.measured;

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
