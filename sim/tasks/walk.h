#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "sim/tasks/task.h"

namespace plumb {

/// Walking at a commanded velocity on legs below a floating trunk: task.velocity = (forward and to
/// the left [m/s], turning to the left [rad/s]) in the trunk's heading. With u, w the trunk's
/// velocity and rate in its own axes, g the direction of gravity there, e = v - commanded:
///   observation  g; u; w; height [m]; each driven joint's angle from its rest; its speed
///   reward       per step at whose end it has not fallen, after Rudin et al., "Learning to walk in
///                minutes using massively parallel deep reinforcement learning", CoRL 2021, table
///                4, with legged_gym's weights: those of legged_robot_config.py, but for the
///                orientation's, of anymal_c_flat_config.py, and the torque's, of a1_config.py. The
///                last term is ours. Its air time of the feet, changes of actions and collisions
///                do not count here, and a sum below zero stays one:
///                  exp(-|e_xy|^2 / 0.25) + 0.5 exp(-e_turn^2 / 0.25)
///                  - 2 u_z^2 - 0.05 (w_x^2 + w_y^2) - 5 (g_x^2 + g_y^2)
///                  - 2e-4 sum torque^2 - 2.5e-7 sum acceleration^2 - 0.1 mean (angle - rest)^2
///                torque what the drive makes (DriveEffort)
///   start        at rest, legs at their joints' rest, the feet on the ground; angles and speeds
///                of the joints +- 0.1, heading any
/// Terminates with a fall: the trunk leans by more than 60 degrees or is lower than half of where
/// it stands; or a state that is not finite. Thread-safe, as Task.
class WalkTask : public Task {
 public:
  /// @throws std::invalid_argument unless the robot has three slides along x, y, z and a spherical
  /// joint without motors, then turning joints with.
  explicit WalkTask(const RobotDescription& description)
      : WalkTask(description, "walk", Eigen::Vector3d(description.task.velocity.data())) {}

  void Observe(const State& q, const State& v, std::span<float> observation) const override;
  double Reward(const State& q, const State& v, const State& effort, const State& next_q,
                const State& next_v) const override;
  bool Terminated(const State& q, const State& v) const override;
  void InitialState(Random& random, Eigen::Ref<Eigen::VectorXd> q,
                    Eigen::Ref<Eigen::VectorXd> v) const override;

 protected:
  WalkTask(const RobotDescription& description, const std::string& name,
           const Eigen::Vector3d& command);

  /// [m] of the trunk, its feet on the ground and its joints at rest.
  double standing_height() const { return height_; }
  const Eigen::VectorXd& rest() const { return rest_; }  ///< [rad] of the driven joints

 private:
  Eigen::Vector3d command_;
  double period_;
  double height_;
  Eigen::VectorXd rest_;
  struct Drive {
    JointDynamics dynamics;
    double effort_limit;
  };
  std::vector<Drive> drives_;  ///< likewise
};

}  // namespace plumb
