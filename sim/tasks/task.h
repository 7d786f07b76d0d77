#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "common/random.h"
#include "robot/description.h"

namespace plumb {

/// What a policy is asked to do with a robot: what it sees, what it is paid, how an episode begins.
/// Immutable, hence thread-safe. States are q [rad or m] and v [rad/s or m/s], one entry per joint.
class Task {
 public:
  using State = Eigen::Ref<const Eigen::VectorXd>;

  virtual ~Task() = default;

  int observation_size() const { return observation_size_; }
  /// One action per joint.
  int action_size() const { return static_cast<int>(effort_limits_.size()); }

  /// Writes what the policy sees. @param observation of observation_size().
  virtual void Observe(const State& q, const State& v, std::span<float> observation) const = 0;

  /// Reward of one control step. @param q, v the state before the step. @param effort commanded for it
  /// [Nm or N], within the limits.
  virtual double Reward(const State& q, const State& v, const State& effort) const = 0;

  /// True where an episode ends for good (falling over). A time limit is not a termination.
  virtual bool Terminated(const State& q, const State& v) const;

  /// Draws the state in which an episode begins. Writes into vectors of the right size; no allocation.
  virtual void InitialState(Random& random, Eigen::Ref<Eigen::VectorXd> q,
                            Eigen::Ref<Eigen::VectorXd> v) const = 0;

  /// Units in which errors of predicted states are measured, so that angles and velocities can be added:
  /// (scale of q, scale of v), 2 * joints entries > 0.
  const Eigen::VectorXd& state_scale() const { return state_scale_; }

  /// Policy units to effort: clips to [-1, 1] and multiplies by the joints' effort limits. A NaN becomes zero
  /// effort. No allocation when `effort` has the right size.
  void Effort(std::span<const float> action, Eigen::Ref<Eigen::VectorXd> effort) const;

 protected:
  Task(const RobotDescription& description, int observation_size, Eigen::VectorXd state_scale);

 private:
  int observation_size_;
  Eigen::VectorXd state_scale_;
  Eigen::VectorXd effort_limits_;
};

/// Makes the task that `description.task.name` names.
/// @throws std::invalid_argument if there is none of that name (names the nearest) or it does not fit the
/// robot.
std::unique_ptr<Task> MakeTask(const RobotDescription& description);

/// Names of all tasks.
std::vector<std::string> TaskNames();

}  // namespace plumb
