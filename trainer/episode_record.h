#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "common/ranks.h"
#include "trainer/moments.h"

namespace plumb {

/// One episode as it was played by one rank, before it is part of a Batch. The observations and
/// actions are those that are learnt from: as the network saw them, observations x steps, and as
/// drawn, actions x steps; empty if nothing is.
struct EpisodeRecord {
  std::vector<float> observations, actions;
  std::vector<double> rewards;        ///< one per step
  Eigen::VectorXf final_observation;  ///< after the last step
  /// of the observations as the task gives them, if it is learnt from
  ObservationMoments moments;
  double sum = 0;           ///< of the rewards
  bool terminated = false;  ///< false: cut off by the time limit
  /// false: something was not finite, or there is no such simulator
  bool usable = false;

  int steps() const { return static_cast<int>(rewards.size()); }
};

/// The episodes of all ranks, in the order of ranks. Called by all of them, by one thread each.
std::vector<EpisodeRecord> Gather(const Ranks& ranks, std::vector<EpisodeRecord> mine);

}  // namespace plumb
