#pragma once

#include <deque>
#include <utility>
#include <vector>

#include "estimator/kinematic_filter.h"
#include "plumb/joint_state_t.hpp"
#include "plumb/robot_state_t.hpp"
#include "robot/description.h"

namespace plumb {

/// Turns JOINT_STATE into ROBOT_STATE (causal) and ROBOT_STATE_SMOOTHED (the same sequence numbers, `lag`
/// measurements later, sooner when the filter restarts). Time advances by differences of utime only, so a log
/// gives the same states at any speed of replay. Not thread-safe.
///
/// The filter restarts after a jump of time (backwards, or more than a second forwards) and when the robot has
/// evidently been moved by hand (innovation above reset_after); such a state says `restarted`. It is `valid`
/// when all joints are and the filter has settled.
class StateObserver {
 public:
  explicit StateObserver(const RobotDescription& robot);

  /// Handles a measurement. @return false if it was refused: wrong number of joints, not finite, not newer.
  bool OnJointState(const joint_state_t& measured);

  /// The causal state after the last accepted measurement.
  const robot_state_t& state() const { return state_; }
  /// Smoothed states that became ready with the last measurement; the caller takes them.
  std::vector<robot_state_t> TakeSmoothed() { return std::exchange(ready_, {}); }

  int64_t refused() const { return refused_; }
  int64_t restarts() const { return restarts_; }

 private:
  bool Acceptable(const joint_state_t& measured) const;
  /// Whether the joint was measured since the last message.
  bool IsNew(const joint_state_t& measured, size_t joint) const { return measured.measured[joint] != measured_[joint]; }
  bool Displaced(const joint_state_t& measured) const;
  void Restart(const joint_state_t& measured);
  void EmitSmoothed();

  int n_;
  EstimatorSettings settings_;
  std::vector<KinematicFilter> filters_;
  robot_state_t state_{};
  std::deque<robot_state_t> waiting_;  // causal states whose smoothed twins are due
  std::vector<robot_state_t> ready_;
  std::vector<int64_t> measured_;  // when each joint was, as of the last message
  std::vector<double> effort_;     // mean applied effort of the previous interval
  int since_restart_ = 0;
  bool started_ = false;
  double unknown_step_;  // [Nm] assumed change of an effort that is not known: from full one way to full the other
  int64_t refused_ = 0;
  int64_t restarts_ = 0;
};

}  // namespace plumb
