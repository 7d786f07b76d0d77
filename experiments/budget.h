#pragma once

#include <cstdint>
#include <vector>

#include "calibrator/motion/transitions.h"
#include "robot/parameter_distribution.h"

namespace plumb {

struct BudgetedFit {
  ParameterDistribution distribution;
  int64_t simulated_steps = 0;  ///< that it took
  int64_t transitions = 0;      ///< of the roll-outs that it rests on
};

/// Plumbline's default method, begun at the prior's mean, with as many of the roll-outs'
/// transitions, spread over all of them, as it can fit within so many simulated control steps. What
/// a fit costs per transition is not known beforehand: one that has cost too much does not count,
/// nor does its cost, and is tried again with fewer transitions.
/// @throws std::invalid_argument if not even 10 transitions can be fitted.
BudgetedFit FitWithin(const RobotDescription& robot, const std::vector<Rollout>& rollouts,
                      int64_t budget, uint64_t seed, int threads);

/// The first so many transitions.
std::vector<Rollout> FirstTransitions(const std::vector<Rollout>& rollouts, int64_t count);

/// About so many transitions, in stretches of 25 that are spread over the roll-outs evenly.
std::vector<Rollout> SpreadTransitions(const std::vector<Rollout>& rollouts, int64_t count);

}  // namespace plumb
