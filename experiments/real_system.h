#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "calibrator/motion/transitions.h"
#include "controller/policy.h"
#include "controller/trial.h"

namespace plumb {

/// An episode on a robot, as far as it went.
struct RobotEpisode {
  Rollout rollout;  ///< as the observer has it
  double sum_of_rewards = 0;
  double seconds = 0;              ///< of the robot's time
  Eigen::VectorXd last_q, last_v;  ///< the causal state that it has ended with
  Trial trial;                     ///< what it tells of the policy, if that did not explore
};

/// The system that policies are trained for. Nothing may be learnt of it but from its episodes.
/// Not thread-safe.
class RealSystem {
 public:
  virtual ~RealSystem() = default;

  /// @param explore actions are drawn from the policy; else they are its mean.
  /// @param steps at most; the task's own time limit holds, too. @param number names the random
  /// numbers, together with the system's seed.
  virtual RobotEpisode Run(const GaussianPolicy& policy, bool explore, int steps,
                           uint32_t number) = 0;
};

}  // namespace plumb
