#pragma once

#include "sim/tasks/task.h"

namespace plumb {

/// Hopping forward: OpenAI gym's Hopper-v2. q = (x, z, pitch of the torso, thigh, leg, foot).
///   observation  q without x, then v clipped to [-10, 10]
///   reward       (x' - x) / period + 1 - 0.001 |a|^2, x' after the step, a the actions in [-1, 1]
///   start        q = (0, 1.25, 0, 0, 0, 0) and v = 0, each entry plus U(-0.005, 0.005)
///   terminated   unless z > 0.7, |pitch| < 0.2, and all entries but x and z within +-100
/// gym's own action is charged as the policy gives it; here it is clipped first.
///
/// Errors of predicted states are measured in units of what a hop makes of each: 1 m forward, 0.5 m
/// up, 0.2 rad of the torso (where it falls) and 1 rad of the others; 2 m/s, 2 rad/s of the torso,
/// and 10 rad/s of the others. Thread-safe, as Task.
class HopperTask : public Task {
 public:
  /// @throws std::invalid_argument unless the robot has gym's six joints: two slides and a turning
  /// joint without motors, then three turning ones with.
  explicit HopperTask(const RobotDescription& description);

  void Observe(const State& q, const State& v, std::span<float> observation) const override;
  double Reward(const State& q, const State& v, const State& effort, const State& next_q,
                const State& next_v) const override;
  bool Terminated(const State& q, const State& v) const override;
  void InitialState(Random& random, Eigen::Ref<Eigen::VectorXd> q,
                    Eigen::Ref<Eigen::VectorXd> v) const override;
  /// -1 to 1, as in gym.
  double action_unit(int action) const override { return effort_limits()[action]; }

 private:
  double period_;
};

}  // namespace plumb
