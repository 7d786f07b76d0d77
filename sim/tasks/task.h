#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "common/random.h"
#include "robot/description.h"

namespace plumb {

/// The work of a policy on a robot: its observations, its reward, how an episode begins.
/// Immutable, hence thread-safe. States are q [rad or m] and v [rad/s or m/s] as in
/// RobotDescription.
class Task {
 public:
  using State = Eigen::Ref<const Eigen::VectorXd>;

  virtual ~Task() = default;

  int observation_size() const { return static_cast<int>(observation_names_.size()); }
  /// The name of each observation, with its unit unless that is 1: "cos(q/pole)", "v/pole [rad/s]".
  /// A policy that was trained with other names, or in another order, is another task's.
  const std::vector<std::string>& observation_names() const { return observation_names_; }
  /// One action per driven joint.
  int action_size() const { return static_cast<int>(effort_limits_.size()); }
  /// Names of the driven joints.
  const std::vector<std::string>& action_names() const { return action_names_; }
  /// Where the driven joints are in v and in efforts.
  const std::vector<int>& action_indices() const { return action_indices_; }
  /// Effort [Nm or N] of one unit in which people count this task's actions: 1 Nm unless the task
  /// has a custom of its own, such as gym's -1 to 1. Tables show effort / action_unit.
  virtual double action_unit(int action) const;

  /// Writes what the policy sees. @param observation of observation_size().
  virtual void Observe(const State& q, const State& v, std::span<float> observation) const = 0;

  /// Reward of one control step. @param q, v the state before the step. @param effort commanded for
  /// it [Nm or N], one per velocity, within the limits. @param next_q, next_v the state after it.
  virtual double Reward(const State& q, const State& v, const State& effort, const State& next_q,
                        const State& next_v) const = 0;

  /// True where an episode ends for good (falling over). A time limit is not a termination.
  virtual bool Terminated(const State& q, const State& v) const;

  /// Draws the state in which an episode begins. Writes into vectors of the right size; no
  /// allocation.
  virtual void InitialState(Random& random, Eigen::Ref<Eigen::VectorXd> q,
                            Eigen::Ref<Eigen::VectorXd> v) const = 0;

  /// Units in which errors of predicted states are measured, so that angles and velocities can be
  /// added: (scale of q's differences, scale of v), 2 num_velocities entries > 0.
  const Eigen::VectorXd& state_scale() const { return state_scale_; }

  /// Policy units to effort: clips to [-1, 1] and multiplies by the joints' effort limits. A NaN
  /// becomes zero effort. @param effort one per velocity; zero where no motor is. No allocation.
  void Effort(std::span<const float> action, Eigen::Ref<Eigen::VectorXd> effort) const;

 protected:
  /// @throws std::invalid_argument if the robot drives a spherical joint: it would take three
  /// motors.
  Task(const RobotDescription& description, std::vector<std::string> observation_names,
       Eigen::VectorXd state_scale);

  const Eigen::VectorXd& effort_limits() const { return effort_limits_; }

 private:
  std::vector<std::string> observation_names_;
  Eigen::VectorXd state_scale_;
  Eigen::VectorXd effort_limits_;
  std::vector<std::string> action_names_;
  std::vector<int> action_indices_;
  int num_efforts_;
};

/// The same angle in [-pi, pi).
double WrapAngle(double angle);

/// Names of the velocities of all joints as observations: "v/<joint> [rad/s]" or "[m/s]"; a
/// spherical joint's three are called <joint>/x, /y and /z.
std::vector<std::string> VelocityNames(const RobotDescription& description);

/// Makes the task that `description.task.name` names.
/// @throws std::invalid_argument if there is none of that name (names the nearest) or it does not
/// fit the robot.
std::unique_ptr<Task> MakeTask(const RobotDescription& description);

/// Names of all tasks.
std::vector<std::string> TaskNames();

}  // namespace plumb
