#pragma once

#include "sim/tasks/walk.h"

namespace plumb {

/// Standing on legs below a floating trunk, after having been set down askew: a robot's first task.
/// It is walking (WalkTask) with a command of zero, but for how an episode begins:
///   start        at rest, any heading; the trunk 3 cm above where it stands, pitch and roll within
///                +-0.1; angles and speeds of the joints +- 0.2
/// Thread-safe, as Task.
class StandTask : public WalkTask {
 public:
  /// @throws std::invalid_argument if the robot is none for WalkTask, or a velocity is commanded.
  explicit StandTask(const RobotDescription& description);

  void InitialState(Random& random, Eigen::Ref<Eigen::VectorXd> q,
                    Eigen::Ref<Eigen::VectorXd> v) const override;
};

}  // namespace plumb
