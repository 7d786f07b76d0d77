#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "dashboard/prediction.h"
#include "dashboard/topics.h"
#include "plumb/parameter_distribution_t.hpp"
#include "plumb/robot_state_t.hpp"
#include "robot/parameter_distribution.h"
#include "sim/view/scene_update.h"

namespace plumb {

/// What is not said on LCM, but follows from it: PLUMB_PREDICTION, PLUMB_SCENE,
/// PLUMB_FRAME and PLUMB_POSTERIOR.
/// Computed where somebody listens, and at most so often as eyes can follow. Not thread-safe.
class Derived {
 public:
  static constexpr int64_t kPredictionPeriod = 20'000, kScenePeriod = 33'333;  ///< [us]

  /// A robot that cannot be simulated has no predictions.
  Derived(const RobotDescription& robot, Topics& topics);

  /// @param utime [us] of the run, which a state may belie. @param now monotonic [us].
  void OnState(const robot_state_t& state, int64_t utime, int64_t now);
  /// Of PLUMB_SCENE and PLUMB_FRAME: the robot as it was last seen, without a prediction.
  std::optional<Topics::Message> Newest(uint32_t topic) const;
  /// What is no distribution of this robot's is passed over. @param utime [us] of the run.
  void OnDistribution(const parameter_distribution_t& message, int64_t utime);

 private:
  const RobotDescription robot_;
  const ParameterDistribution prior_;
  Topics& topics_;
  const uint32_t predictions_, scenes_, frames_, posteriors_;
  const SceneUpdate scene_;
  std::optional<OneStepPrediction> prediction_;
  int64_t utime_ = 0;  // of the run, at the newest state that is one of this robot's
  Eigen::VectorXd q_;  // of the same; empty: there is none
  int64_t next_prediction_ = 0, next_scene_ = 0;
};

}  // namespace plumb
