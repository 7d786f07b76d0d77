#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "plumb/controller_status_t.hpp"
#include "plumb/policy_t.hpp"
#include "plumb/training_status_t.hpp"
#include "robot/parameter_distribution.h"
#include "trainer/acceptance.h"
#include "trainer/checkpoint.h"
#include "trainer/trainer.h"

namespace plumb {

/// Whether a policy, and the one that [training] `hidden` makes, can be sent: sealed it may have
/// kMaxLcmMessage bytes. Both are thread-safe.
/// @throws std::invalid_argument if it cannot, one line for people.
void RequireSendable(const GaussianPolicy& policy);
void RequireSendable(const RobotDescription& robot);

/// The policy of a file, to be sent. Warns as RequireTrained. Thread-safe. @throws as LoadPolicy,
/// RequireTrained (trainer/policy_file.h) and RequireSendable, naming the file.
GaussianPolicy LoadSendablePolicy(const std::string& file, const RobotDescription& robot);

/// The trainer's part of SimOpt: for each distribution of simulators a policy. Iteration 0 trains
/// from scratch, each later one from where the last ended.
///
/// Each policy but the last begins its roll-out with a trial, without exploration ([training]
/// `trial`), and is judged by it when the next distribution is there (Acceptance): it becomes the
/// incumbent if it does better than the one of before or, where that distribution explains the
/// robot (ParameterDistribution::explained), in any case. The last one has no trial: where its
/// distribution explains the robot it is the incumbent, else the one of before is what the robot is
/// run with in the end. Training goes on from the newest policy whatever the trials say.
///
/// Knows neither clocks nor who sends. Not thread-safe.
class TrainingSession {
 public:
  /// @param iterations number N of distributions that follow the prior: the policy of iteration N
  /// is the last.
  /// @param make makes simulations. @param threads 0 = as many as the machine has.
  /// @throws std::invalid_argument as RequireSendable.
  TrainingSession(const RobotDescription& description, const SimulationFactory& make,
                  int iterations, uint64_t seed, int threads);

  /// Goes on where a checkpoint stands. @throws CheckpointError if it is of another run: seed,
  /// robot or network.
  void Restore(const Checkpoint& checkpoint);
  Checkpoint MakeCheckpoint() const;

  /// The iteration whose distribution is awaited; -1 while training and after the last.
  int awaited() const;
  /// The complete iteration's policy is to be tried on the robot before the next one begins.
  bool awaits_trial() const;
  /// The trial of the policy that awaits it. @return false, and nothing happens, if these are not
  /// the finished episodes of that policy, or have sizes or numbers that cannot be.
  bool AddTrial(const controller_status_t& status);
  /// Begins the iteration, once the policy of before has been tried. @return false, and nothing
  /// happens, if it is not the one that is awaited. @throws std::invalid_argument, and nothing
  /// happens, if its residual is another robot's, or half of the simulators that are drawn from it
  /// cannot be simulated, as Replace does.
  bool Begin(const ParameterDistribution& distribution);

  /// Goes on training with another distribution of the same iteration, from the next batch on.
  /// @return false, and nothing happens, if there is no training, or it is of another iteration, or
  /// no other.
  bool Replace(const ParameterDistribution& distribution);

  bool training() const { return begun_ && !complete_; }
  /// One update; after the last of an iteration evaluates the policy and completes it.
  /// Only while training. @throws std::runtime_error if the simulations cannot be used.
  UpdateReport Advance();

  /// There is a policy to be sent: that of the latest iteration, until the next one begins.
  bool complete() const { return complete_; }
  /// Of the last iteration.
  bool finished() const { return complete_ && last(); }
  /// The iteration is the last.
  bool last() const { return iteration_ == iterations_; }
  int iteration() const { return iteration_; }
  /// TRPO updates done and planned in this iteration.
  int update() const { return update_; }
  int updates() const;
  /// Of the complete iteration's policy.
  const Evaluation& evaluation() const { return evaluation_; }

  /// The iteration whose policy the robot is to be run with, and the one in which that was chosen;
  /// -1 = none yet. Without trials the newest.
  int incumbent() const;
  int incumbent_since() const;
  /// The last choice; its challenger is -1 before the first.
  const Acceptance::Decision& decision() const { return decision_; }

  /// The complete iteration's policy, in the end the incumbent, its purpose and how many roll-outs
  /// are wanted; utime is the sender's.
  /// @param evaluation_episodes roll-outs in the end; of any other policy one is wanted, in two
  /// episodes if the first of them is a trial.
  policy_t Policy(int evaluation_episodes) const;
  /// utime and seconds are the sender's.
  training_status_t Status() const;

 private:
  void RequireSimulable(const ParameterDistribution& distribution);
  int trial_steps() const;
  void Adopt(const Acceptance::Decision& decision, int iteration);

  RobotDescription description_;
  int iterations_;
  uint64_t seed_;
  Trainer trainer_;
  ParameterDistribution distribution_;
  bool begun_ = false;  // iteration_ means something
  bool complete_ = false;
  int iteration_ = 0;
  int update_ = 0;
  Evaluation evaluation_;
  UpdateReport last_;
  Acceptance acceptance_;
  Acceptance::Decision decision_;
  int incumbent_since_ = -1;
  std::optional<GaussianPolicy> incumbent_policy_;
};

}  // namespace plumb
