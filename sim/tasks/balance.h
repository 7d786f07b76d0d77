#pragma once

#include <vector>

#include "sim/tasks/reach.h"

namespace plumb {

/// Staying near task.target without a fall, for any robot: gym's InvertedPendulum, with a price for
/// effort. A robot has fallen where a joint that task.fall names is further than that from its
/// target, by the short way round; a spherical one by the angle of its rotation.
///   observation  as ReachTask's
///   reward       1 - 0.01 mean (u/limit)^2 over the driven joints for a step at whose end it has
///                not fallen, without the 1 for one at whose end it has
///   start        as HoldTask's
/// Terminates with a fall, or a state that is not finite. Thread-safe, as Task.
class BalanceTask : public HoldTask {
 public:
  /// @throws std::invalid_argument if task.fall names no joint, or one that may begin fallen.
  explicit BalanceTask(const RobotDescription& description);

  double Reward(const State& q, const State& v, const State& effort, const State& next_q,
                const State& next_v) const override;
  bool Terminated(const State& q, const State& v) const override;

 private:
  std::vector<double> fall_;  // [rad] or [m], of each joint; infinite where it cannot fall
};

}  // namespace plumb
