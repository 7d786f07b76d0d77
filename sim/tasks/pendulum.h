#pragma once

#include "sim/tasks/task.h"

namespace plumb {

/// Swing-up of OpenAI gym's Pendulum: q = 0 is upright.
///   observation  (cos q, sin q, v)
///   reward       -(wrap(q)^2 + 0.1 v^2 + 0.001 u^2) of the state before the step, wrap to
///                [-pi, pi), u [Nm]
///   start        q ~ U(-pi, pi), v ~ U(-1, 1)
/// Never terminates. Errors are measured in units of 1 rad and 8 rad/s, gym's bound of the speed:
/// about what a 1 m rod reaches at the bottom when it falls from the top, sqrt(6 g / l) = 7.7
/// rad/s. Thread-safe, as Task.
class PendulumTask : public Task {
 public:
  /// @throws std::invalid_argument unless the robot has exactly one joint and that one turns.
  explicit PendulumTask(const RobotDescription& description);

  void Observe(const State& q, const State& v, std::span<float> observation) const override;
  double Reward(const State& q, const State& v, const State& effort, const State& next_q,
                const State& next_v) const override;
  void InitialState(Random& random, Eigen::Ref<Eigen::VectorXd> q,
                    Eigen::Ref<Eigen::VectorXd> v) const override;
};

}  // namespace plumb
