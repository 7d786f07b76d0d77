#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "calibrator/live/simopt.h"
#include "chaos/chronicle.h"
#include "chaos/message_witness.h"
#include "common/signature.h"
#include "plumb/lockstep_post_t.hpp"
#include "robot/description.h"

namespace plumb {

/// Sees, when a run is over, from the calibrator's journal and what it was told that
/// - each episode which was completed, and each transition of it which it had to accept, counts
///   once, with the states that were said, and no other does (invariant 4);
/// - its posteriors and distributions are those of an undisturbed calibration of the same
///   transitions, to the bit (5).
/// Not thread-safe.
class JournalWitness {
 public:
  JournalWitness(const RobotDescription& robot, std::string bus, const SigningKey& key,
                 Chronicle& chronicle)
      : robot_(robot), bus_(std::move(bus)), key_(key), chronicle_(chronicle) {}

  /// The calibrator has been started. @param time [us]
  void OnStart(int64_t time) { lives_.push_back({time, {}}); }
  /// It is told something. In any order.
  void OnHeard(const lockstep_post_t& post);
  /// @param folder of its journal. @param said on the bus. @return the transitions in it.
  int Judge(int64_t time, const std::filesystem::path& folder, uint64_t seed,
            const MessageWitness& said);

 private:
  struct Life {
    int64_t beginning;
    std::vector<lockstep_post_t> heard;
  };

  void JudgeRollouts(int64_t time, const SimOpt::State& journal);
  void JudgeFindings(int64_t time, const std::filesystem::path& folder, uint64_t seed,
                     const SimOpt::State& journal, const MessageWitness& said);

  const RobotDescription& robot_;
  const std::string bus_;
  const SigningKey key_;
  Chronicle& chronicle_;
  std::vector<Life> lives_;
};

}  // namespace plumb
