#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "controller/policy.h"
#include "controller/trial.h"
#include "plumb/controller_status_t.hpp"
#include "plumb/driver_status_t.hpp"
#include "plumb/joint_command_t.hpp"
#include "plumb/place_robot_t.hpp"
#include "plumb/policy_t.hpp"
#include "plumb/robot_state_t.hpp"
#include "robot/configuration_space.h"
#include "robot/description.h"
#include "robot/placement.h"
#include "sim/tasks/task.h"

namespace plumb {

/// Runs a policy on the robot, episode by episode. Without sockets or clocks: time is an argument
/// (`now` scaled monotonic, `utime` scaled real time, both [us]). Not thread-safe.
///
/// - A policy is exchanged only between episodes.
/// - Between episodes it commands zero effort, which keeps an armed driver from disarming.
/// - It is silent unless the driver is arming or armed, and after a halt: silence disarms.
/// - A late (by arrival or by its own time), invalid or non-finite state, one with a quaternion
///   that is no unit one, or a non-finite action halts it: one command of zero effort, then silence
///   until the driver has been seen disarmed and armed anew, which takes a person.
/// - An episode that ends like that is run anew. But a robot whose base only its legs and an IMU
///   tell of ([estimator] base = "legs"), and that no longer knows where it is, has fallen: its
///   episode counts, up to the last state that was acted on.
class Controller {
 public:
  /// @param rest [s] negative: each episode begins in a state of the task's choice, where
  /// PLACE_ROBOT has the robot put. Otherwise, for a robot that nobody can place: it is given zero
  /// effort for that long and the episode begins wherever it then is.
  Controller(const RobotDescription& robot, uint64_t seed, double rest = -1);

  /// What is to be done, policy units, where this is observed, as a policy has it (not normalised),
  /// and the episode has come so far.
  using Decide =
      std::function<Eigen::VectorXf(const Eigen::VectorXf& observation, const Trial& so_far)>;
  /// From now on this decides, not the policy: a robot that is trained on itself.
  void SetDecision(Decide decide) { decide_ = std::move(decide); }

  /// From now on no policy is needed: one episode has these actions one after the other, policy
  /// units, and is to calibrate with. @param actions control steps x driven joints.
  void Play(Eigen::MatrixXf actions);

  /// A new policy. @throws std::invalid_argument if it does not fit the robot or is damaged.
  void OnPolicy(const policy_t& message);
  void OnDriverStatus(const driver_status_t& status, int64_t now);
  /// A state. @return the command that answers it, if one is due.
  std::optional<joint_command_t> OnState(const robot_state_t& state, int64_t now, int64_t utime);
  /// Call at least every control period. @return a command of zero effort when it halts here.
  std::optional<joint_command_t> Tick(int64_t now, int64_t utime);

  /// The wish to place the robot, while phase() is PLACING and the drives have had the time to let
  /// go of it; else null.
  const place_robot_t* place() const { return place_ && let_go_ ? &*place_ : nullptr; }
  const controller_status_t& status() const { return status_; }
  int8_t phase() const { return status_.phase; }
  /// Counts changes of phase: publish the status when it moves.
  int64_t changes() const { return changes_; }

 private:
  static Eigen::Map<const Eigen::VectorXd> Map(const std::vector<double>& values) {
    return {values.data(), static_cast<Eigen::Index>(values.size())};
  }
  bool Armed() const { return driver_state_ == driver_status_t::ARMED; }
  void Enter(int8_t phase, const std::string& reason = {});
  void TakePolicy();
  void SeeDriver(const driver_status_t& status, int64_t now);
  void BeginPlacing(int64_t now, int64_t utime);
  bool ReadyToRun(const robot_state_t& state, int64_t now) const;
  bool Placed(const robot_state_t& state) const;
  bool Trying() const;
  int StepLimit() const;
  void FinishEpisode(int64_t last_state_sequence, bool fell);
  joint_command_t Halt(const std::string& reason, int64_t utime);
  joint_command_t ZeroCommand(int64_t utime);
  std::optional<joint_command_t> Act(const robot_state_t& state, int64_t utime);

  const RobotDescription robot_;
  ConfigurationSpace space_;
  Placement placement_;
  std::unique_ptr<Task> task_;
  std::vector<int> driven_;  // joints
  uint64_t seed_;
  double rest_;
  Decide decide_;        // empty: the policy does
  bool halted_ = false;  // since the driver has last said that it is not armed
  bool plays_ = false;   // what is decided needs no policy
  int most_steps_;       // of an episode
  std::unique_ptr<GaussianPolicy> policy_, next_policy_;
  policy_t policy_header_{}, next_header_{};  // without weights
  controller_status_t status_{};
  int64_t changes_ = 0;

  int8_t driver_state_ = driver_status_t::ABSENT;
  std::string driver_reason_;
  int64_t driver_heard_ = 0;
  int64_t state_heard_ = -1;  // now of the last valid state; -1 before the first
  int64_t sequence_ = 0;
  int64_t last_state_sequence_ = -1;

  std::optional<place_robot_t> place_;
  int64_t placing_since_ = 0;
  bool let_go_ = false;  // the efforts are zero by now
  // keys the initial state and the exploration: a repeated episode is another one
  int64_t attempt_ = 0;

  int64_t episode_ = -1;
  int64_t first_state_sequence_ = 0;
  int64_t acted_on_ = -1;      // sequence of the last state that was answered with an effort
  int64_t next_decision_ = 0;  // utime of the state that is to be answered next
  // Of the step under way, whose reward is known when it ends.
  Eigen::VectorXd step_q_, step_v_, effort_;
  Eigen::VectorXf observation_;
  Trial record_;  // of the episode under way
};

}  // namespace plumb
