#pragma once

#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "plumb/parameter_distribution_t.hpp"
#include "plumb/policy_t.hpp"
#include "plumb/training_status_t.hpp"
#include "trainer/acceptance.h"
#include "trainer/critic.h"
#include "trainer/evaluation.h"
#include "trainer/trainer.h"

namespace plumb {

/// A checkpoint that cannot be used: damaged, of another version, or not writable. The message
/// names the file.
struct CheckpointError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// What a policy did in a trial on the robot.
struct TriedPolicy {
  int32_t iteration = 0;  ///< names it
  Trial trial;
};

/// The state of training. Everything that shapes its future is here, so that a resumed run gives
/// the same bits. All functions of this header are thread-safe for different files.
struct Checkpoint {
  uint64_t seed = 0;
  uint64_t robot = 0;  ///< RobotDescription::fingerprint
  /// of all that a run of `plumb train` depends on; in the trainer process of all that the
  /// iteration depends on, in virtual time, and else 0
  uint64_t identity = 0;
  int64_t updates = 0, steps = 0, dropped_episodes = 0;  ///< as in TrainerState
  int32_t iteration = 0;          ///< of SimOpt; the one under way or, if complete, just done
  int32_t iteration_updates = 0;  ///< TRPO updates done in it
  bool complete = false;
  Evaluation evaluation;       ///< of the policy, once it is complete
  double training_return = 0;  ///< of the last batch
  policy_t policy{};
  parameter_distribution_t distribution{};  ///< of the iteration
  CriticState critic;
  ObservationMoments observations;  ///< as in TrainerState
  /// JudgedPolicy of TrainerState, if there is one
  bool judged = false;
  policy_t best_policy{};
  CriticState best_critic;
  ObservationMoments best_observations;
  int64_t best_updates = 0;
  double best_return = 0;
  /// See TrainingSession: the trials, the last choice (challenger -1: none), the iteration in which
  /// the incumbent was chosen and, if there is an incumbent, its policy.
  std::vector<TriedPolicy> trials;
  Acceptance::Decision decision;
  int32_t incumbent = -1, incumbent_since = -1;
  policy_t incumbent_policy{};
  /// of the iteration's updates, in virtual time; see PastTrainings
  std::vector<training_status_t> statuses;
};

/// The policy that the robot is to be run with: the incumbent's, else the newest. Thread-safe.
const policy_t& DeployedPolicy(const Checkpoint& checkpoint);

/// A trainer process' in the folder that it is given.
inline constexpr char kTrainerCheckpoint[] = "trainer.checkpoint";
/// @param robot its fingerprint. @param iterations as TrainingSession has them.
/// @throws CheckpointError if a session with these cannot go on from there.
void RequireContinues(const Checkpoint& checkpoint, uint64_t robot, uint64_t seed, int iterations);

/// What a checkpoint has of the trainer. @throws std::invalid_argument if a policy is none.
TrainerState TrainerStateOf(const Checkpoint& checkpoint);
void SetTrainerState(const TrainerState& state, Checkpoint& checkpoint);

/// Writes it so that at any moment, also after a power cut, the file is either the old checkpoint
/// or the new one: a temporary file, fsync, rename, fsync of the folder. @throws CheckpointError.
void SaveCheckpoint(const std::string& file, const Checkpoint& checkpoint);

/// The same as bytes, e.g. for another process of this machine's kind. @throws CheckpointError if
/// they are not what was encoded.
std::string EncodeCheckpoint(const Checkpoint& checkpoint);
Checkpoint DecodeCheckpoint(std::string_view bytes);

/// Whether a file that begins with these bytes may be a checkpoint.
bool IsCheckpoint(std::string_view bytes);

/// @return nothing if there is no such file. @throws CheckpointError if it is not what was saved.
std::optional<Checkpoint> LoadCheckpoint(const std::string& file);

}  // namespace plumb
