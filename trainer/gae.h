#pragma once

#include <span>
#include <vector>

namespace plumb {

/// The steps [begin, end) of a batch, begin < end, that are one episode.
struct EpisodeSpan {
  int begin, end;
  bool terminated;  ///< false: cut off by the time limit, and the task would have gone on
};

/// Advantages and value targets of a batch, one per step. All functions of this header are
/// thread-safe.
struct Advantages {
  std::vector<double> advantage;
  std::vector<double> target;  ///< of V: advantage + value
};

/// Generalised advantage estimation (Schulman et al., 2016): with d_t = r_t + gamma V(s_{t+1}) -
/// V(s_t), A_t = sum over l of (gamma lambda)^l d_{t+l} to the episode's end. After a terminal step
/// V(s_{t+1}) is 0; at a time limit it is the value of the observation then, because the limit is
/// no part of the task.
/// @param rewards,values one per step of the batch. @param episodes together cover the batch.
/// @param final_values V of the observation after the last step, one per episode; not used where
/// that has terminated.
Advantages EstimateAdvantages(std::span<const double> rewards, std::span<const double> values,
                              std::span<const EpisodeSpan> episodes,
                              std::span<const double> final_values, double gamma, double lambda);

/// Shifts and scales to mean 0 and standard deviation 1; to all zeros if they do not differ.
void Normalize(std::span<double> advantages);

}  // namespace plumb
