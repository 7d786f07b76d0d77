#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "common/special_numbers.h"
#include "plumb/joint_command_t.hpp"
#include "plumb/robot_state_t.hpp"
#include "robot/configuration_space.h"
#include "robot/description.h"
#include "sim/simulator.h"

namespace plumb {

/// One control step of the robot: s -> s' under the effort that was actually applied, cycle by
/// cycle. The first segments still carry the previous command: it takes milliseconds until a
/// command reaches the motor, and a simulator that ignored that would be calibrated to be wrong.
struct Transition {
  int step;                        ///< in the episode
  Eigen::VectorXd q, v;            ///< smoothed state, finite
  Eigen::VectorXd next_q, next_v;  ///< smoothed state; NaN = not observed
  /// Their standard deviations, num_velocities entries each, q's as ConfigurationSpace has its
  /// differences. 0 = exact; NaN = not known, to be estimated from the errors.
  Eigen::VectorXd q_sd, v_sd, next_q_sd, next_v_sd;
  std::vector<EffortSegment> efforts;  ///< from s to s', gapless
  /// Directions, columns of 2 n entries (positions, velocities), each a standard deviation long, in
  /// which something that no simulator is asked for has moved the end; none = nothing has.
  Eigen::MatrixXd disturbance = {};
  double duration() const;              ///< [s]
  Eigen::VectorXd mean_effort() const;  ///< over the step, [Nm or N] of each velocity
};

/// The usable transitions of one episode, in order of time.
struct Rollout {
  int64_t episode = 0;
  int policy_iteration = 0;
  std::vector<Transition> transitions;
};

/// The number of transitions.
size_t CountTransitions(std::span<const Rollout> rollouts);

/// A step of the record is one control period but for this share of it.
inline constexpr double kPeriodTolerance = 0.2;

/// Why transitions were left out, counted since the start. Nothing is ever guessed.
struct DropCounts {
  int64_t gap = 0;   ///< a state or a command is missing
  int64_t late = 0;  ///< the interval is not one control period (within kPeriodTolerance)
  double late_interval = kNaN;  ///< [s] of the newest of these
  /// a number is not finite or not physical (robot/physical.h), an effort is unknown, or a
  /// quaternion is no unit one
  int64_t not_finite = 0;
  int64_t restart = 0;  ///< the estimator's filter restarted within the interval
  /// the simulator's dynamics are in a state: what it tells of parameters is what was put in
  int64_t model_based = 0;
  int64_t total() const { return gap + late + not_finite + restart + model_based; }
  DropCounts& operator+=(const DropCounts& other);
  /// "1 gap, 2 late, 0 not finite, 3 across restarts", and ", 4 model-based" if there are any
  std::string summary() const;
};

/// Joins ROBOT_STATE_SMOOTHED and JOINT_COMMAND by state_sequence: s is the state a command acted
/// on, s' the state the next command acted on. The result depends on the messages' contents only,
/// not on the order in which the two channels interleave. ROBOT_STATE's effort is a mean over an
/// interval: a step within one is put back to where the means say that it was. Not thread-safe.
class TransitionJoiner {
 public:
  static constexpr size_t kMaxStates = 200'000;  ///< 400 s of a driver at 500 Hz
  /// No driver counts so far; beyond it, sums and differences overflow.
  static constexpr int64_t kMaxSequence = int64_t{1} << 53;

  /// Memory is bounded: the oldest states, and the episodes and commands that came first, are
  /// forgotten, as a process that runs for days must. At most kMaxStates states of 350 bytes and 40
  /// a joint, and 200 000 commands of 64 bytes.
  explicit TransitionJoiner(const RobotDescription& robot);
  /// Nothing is forgotten but by Forget.
  static TransitionJoiner Unbounded(const RobotDescription& robot);

  /// Whether a state is of a driver that has been started again since the newest one, which counts
  /// from 0 then: it is later with a lower number, is numbered 1000 lower, or is earlier than all
  /// that are remembered without a lower number. States of one driver come in about their order.
  bool BeginsRun(const robot_state_t& smoothed) const;

  /// Ignores states of another robot's size, sequences below 0 or beyond kMaxSequence, and times
  /// that are none. One that begins a run makes it forget all states and episodes.
  void OnState(const robot_state_t& smoothed);
  void OnCommand(const joint_command_t& command);

  /// Sequence number of the newest state, -1 before the first.
  int64_t newest_state() const { return states_.empty() ? -1 : states_.rbegin()->first; }

  /// Whether states of an episode that ended with that one may still come: not where the driver has
  /// been started again since, which counts from 0 then.
  bool Awaits(int64_t episode, int64_t last_state) const {
    return newest_state() < last_state && !cut_off_.contains(episode);
  }

  /// The state of that sequence number, null if it was not received or has been forgotten. Valid
  /// until the next call.
  const robot_state_t* FindState(int64_t sequence) const;

  /// Builds the roll-out of an episode from what has been received, and forgets its commands.
  /// @param last_state sequence of the state that ended it.
  Rollout Join(int64_t episode, int64_t last_state);

  /// The transitions of an episode under way that have been received whole since it was last asked
  /// for, their successor's command included: what Join will say of them, unless a message comes
  /// late. Forgets no message and counts nothing.
  std::vector<Transition> TakeArrived(int64_t episode);

  /// Forgets the states before that sequence number.
  void Forget(int64_t sequence) { states_.erase(states_.begin(), states_.lower_bound(sequence)); }

  const DropCounts& drops() const { return drops_; }

 private:
  bool JoinOne(int64_t from, int64_t to, Transition* transition, DropCounts* drops) const;

  /// What is needed of a command.
  struct Answer {
    int64_t state_sequence;
    int32_t policy_iteration;
  };

  struct Episode {
    int64_t number = 0;            // in the order of their first commands
    int next_taken = 0;            // step that TakeArrived has not looked at
    std::map<int, Answer> answer;  // by step
  };
  using Episodes = std::map<int64_t, Episode>;
  void ForgetEpisode(Episodes::iterator episode);
  void ForgetFirstEpisode();

  int num_joints_;
  ConfigurationSpace space_;
  double period_, greatest_effort_;
  size_t max_states_, max_episodes_, max_commands_;
  std::map<int64_t, robot_state_t> states_;  // by sequence
  Episodes episodes_;
  int64_t num_episodes_ = 0;  // ever
  size_t num_commands_ = 0;
  std::set<int64_t> cut_off_;  // episodes that the driver's last restart has taken
  DropCounts drops_;
};

}  // namespace plumb
