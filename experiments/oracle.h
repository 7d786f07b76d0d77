#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "trainer/trainer.h"

namespace plumb {

/// What TRPO reaches in a reality when it may train there as long as it likes.
struct Oracle {
  GaussianPolicy policy;
  int64_t updates = 0;  ///< made; the policy may be an earlier one
  int64_t steps = 0;    ///< of the reality
};

/// Trains in simulations that are the reality (SimulateBusRobot) until the best policy so far is
/// kPatience updates old, or for kMostUpdates. The policy is judged after every kBetween updates,
/// in 30 episodes without exploration; the best one is the result.
/// @param checkpoint the file where it is left after each judgement, and from which it goes on with
/// the same bits. It stays: who has lost the result has it again in no time.
/// @param identity of the reality, the model and the program.
/// @param progress told the share of kMostUpdates that is done; may throw to break off.
/// @throws as Trainer; CheckpointError, also if the checkpoint is of another identity or seed.
Oracle TrainOracle(const RobotDescription& model, const SimulationFactory& reality, uint64_t seed,
                   int threads, const std::string& checkpoint, uint64_t identity,
                   const std::function<void(double)>& progress);

/// Which share of the oracle's return a return is. One below zero is a cost, of which the oracle's
/// is the least.
double ShareOfOracle(double value, double oracle);

inline constexpr int kBetween = 20, kPatience = 160, kMostUpdates = 1200;

}  // namespace plumb
