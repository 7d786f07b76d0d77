#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <vector>

#include "robot/description.h"

namespace plumb {

/// Efforts on their way from a virtual robot's drives to its joints: each acts as much later as
/// description.virtual_robot.joints says, to the microsecond. Not thread-safe.
class EffortDelay {
 public:
  explicit EffortDelay(const RobotDescription& robot);

  /// Efforts that act now, one per velocity [Nm or N].
  const Eigen::VectorXd& acting() const { return acting_; }
  /// A drive makes this effort from `now` [us] on, which does not decrease.
  void Make(Eigen::Index velocity, double effort, int64_t now);
  /// When `acting` next changes by itself [us]; the greatest number if it does not.
  int64_t NextChange() const;
  /// Lets all act that is due.
  void Take(int64_t now);
  /// Nothing acts, and nothing is on its way.
  void Clear();

 private:
  struct Change {
    int64_t at;
    double effort;
  };
  std::vector<int64_t> delay_;  // [us] of each velocity's coordinate
  std::vector<std::deque<Change>> coming_;
  Eigen::VectorXd acting_;
};

}  // namespace plumb
