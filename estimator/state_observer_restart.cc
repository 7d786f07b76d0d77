// Of state_observer.h: when the filter restarts, and from where.

#include <cmath>

#include "common/special_numbers.h"
#include "estimator/moved_by_hand.h"
#include "estimator/state_observer.h"

namespace plumb {
namespace {

constexpr int64_t kPlacing = 50'000;  // [us] until readings have told that the robot is elsewhere

}  // namespace

void StateObserver::Place() {
  if (started_) placed_ = state_.utime;
}

bool StateObserver::Placed(const joint_state_t& measured) const {
  // A clock that was set back begins anew, and says nothing of what was placed before.
  return placed_ && measured.utime >= *placed_ && measured.utime - *placed_ <= kPlacing;
}

bool StateObserver::Displaced(const joint_state_t& measured) const {
  for (size_t i = 0; i < joints_.size(); ++i) {
    if (!IsNew(measured, i)) continue;
    const Joint& joint = joints_[i];
    if (joint.used < 0) return true;  // there it is
    if (joint.out) continue;
    const auto innovation =
        joint.filter.Expect(Quantity::kPosition, measured.position[i], Age(measured, i));
    if (MovedByHand(innovation.value, joint.settings.reset_after, std::sqrt(innovation.variance)))
      return true;
  }
  return false;
}

bool StateObserver::Back(const joint_state_t& measured) const {
  for (size_t i = 0; i < joints_.size(); ++i) {
    if (joints_[i].out && IsNew(measured, i)) return true;
  }
  return false;
}

void StateObserver::RestartAll(const joint_state_t& measured) {
  RestartJoints(measured);
  if (base_) base_->Restart();  // last: what waits is still smoothed
}

void StateObserver::RestartJoints(const joint_state_t& measured) {
  while (num_waiting_ > 0) EmitSmoothed();
  for (size_t i = 0; i < joints_.size(); ++i) {
    Joint& joint = joints_[i];
    const bool known = measured.valid[i];
    // Where an invalid joint is, it will tell when it is back.
    const double position = known                  ? measured.position[i]
                            : joint.filter.sound() ? joint.filter.mean()(0)
                                                   : 0;
    joint.filter.Restart(position, known && !joint.gyro ? measured.velocity[i] : kNaN);
    if (std::isfinite(measured.effort_applied[i])) joint.effort = measured.effort_applied[i];
    joint.stop = 0;
    joint.velocity_watch.Restart();
    joint.acceleration_watch.Restart();
    if (known) joint.used = measured.measured[i];
  }
  ground_ = 0;
  since_restart_ = 0;
  if (started_) ++restarts_;
  started_ = true;
}

}  // namespace plumb
