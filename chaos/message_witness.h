#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "chaos/chronicle.h"
#include "plumb/lockstep_post_t.hpp"

namespace plumb {

/// Sees of what our processes say that
/// - nothing which is not finite counts as valid (invariant 3);
/// - iterations only count up, and what was said of one stays (6);
/// and notes how driver, controller, calibrator and trainer are doing. Not thread-safe.
class MessageWitness {
 public:
  explicit MessageWitness(Chronicle& chronicle) : chronicle_(chronicle) {}

  /// A process has been started: what it counts in memory begins anew.
  void OnStart(const std::string& name);
  /// @param time [us]
  void OnSaid(int64_t time, const lockstep_post_t& post, const std::string& speaker);

  /// Of the newest distribution; 0 = the prior.
  int iteration() const { return iteration_; }
  /// Messages of PARAMETER_DISTRIBUTION, by iteration, without seals.
  const std::map<int, std::vector<uint8_t>>& distributions() const { return distributions_; }
  /// Transitions that the calibrator says it has used, by iteration.
  const std::map<int, int>& transitions() const { return transitions_; }

 private:
  void RequireRising(int64_t time, const std::string& what, int iteration);
  template <class Message>
  void RequireFinite(int64_t time, const std::string& what, const Message& m);
  void NoteChange(int64_t time, const std::string& who, const std::string& state);

  Chronicle& chronicle_;
  std::map<std::string, int> iterations_;  // newest, of each thing that counts them
  std::map<int, std::vector<uint8_t>> distributions_;
  std::map<int, int> transitions_;
  std::map<std::string, std::string> states_;  // told last
  int iteration_ = 0;
};

}  // namespace plumb
