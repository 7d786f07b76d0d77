#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "plumb/training_status_t.hpp"
#include "trainer/session.h"

namespace plumb {

/// Trainings of an earlier life of the same run. A run in virtual time that was killed begins anew
/// and comes to the same bits; what is trained then has been trained before, with the same
/// statuses. They are said again, one for each update, but not computed again.
///
/// Keeps the newest checkpoint of every iteration's training in the trainer's folder,
/// `trainer_<iteration>.checkpoint`: what happens to the policy on the robot is not in it.
/// Not thread-safe.
class PastTrainings {
 public:
  /// @param run fingerprint of all that training depends on, but for what a session's checkpoint
  /// tells.
  PastTrainings(std::filesystem::path folder, uint64_t run)
      : folder_(std::move(folder)), run_(run) {}

  /// The session has begun an iteration. Of a file that is damaged it warns, and the iteration is
  /// trained again.
  void Begin(const TrainingSession& session);
  /// Updates that are known have not been repeated yet: the session stands at the beginning.
  bool repeating() const { return past_.has_value(); }
  /// The next update, if it was made before. With the last of those the session stands behind it.
  /// @return its status. @throws CheckpointError if it is of another robot after all.
  std::optional<training_status_t> Repeat(TrainingSession& session);
  /// The iteration goes on with another distribution: it cannot be repeated.
  void Forget() {
    beginning_ = 0;
    past_.reset();
  }
  /// An update that was not made before has been made.
  void Add(const training_status_t& status) { statuses_.push_back(status); }
  /// The session's checkpoint, with which it can be repeated.
  Checkpoint MakeCheckpoint(const TrainingSession& session) const;
  /// For the next life, while training and when it is complete.
  /// @throws CheckpointError naming the file if it cannot be written.
  void Keep(const TrainingSession& session) const;

 private:
  std::filesystem::path FileOf(int iteration) const;

  std::filesystem::path folder_;
  uint64_t run_;
  uint64_t beginning_ = 0;                   // fingerprint of the iteration's; 0: none
  std::vector<training_status_t> statuses_;  // of its updates so far
  std::optional<Checkpoint> past_;
};

}  // namespace plumb
