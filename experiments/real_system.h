#pragma once

#include <cstdint>

#include "calibrator/motion/transitions.h"
#include "controller/policy.h"

namespace plumb {

/// What a policy has to work on in the end, and all that may be learnt of it is what it did.
class RealSystem {
 public:
  virtual ~RealSystem() = default;

  /// An episode, as far as it went.
  struct Trial {
    Rollout rollout;  ///< as the observer has it
    double sum_of_rewards = 0;
    double seconds = 0;  ///< of the robot's time
  };
  /// @param explore actions are drawn from the policy; else they are its mean.
  /// @param steps at most; the task's own time limit holds, too. @param number names the random
  /// numbers, together with the system's seed.
  virtual Trial Run(const GaussianPolicy& policy, bool explore, int steps, uint32_t number) = 0;
};

}  // namespace plumb
