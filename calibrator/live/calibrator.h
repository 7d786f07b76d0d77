#pragma once

#include <optional>
#include <vector>

#include "calibrator/fit/streaming.h"
#include "calibrator/live/simopt.h"
#include "calibrator/motion/transitions.h"
#include "calibrator/results/findings.h"
#include "plumb/calibration_status_t.hpp"
#include "plumb/controller_status_t.hpp"
#include "plumb/parameter_distribution_t.hpp"
#include "robot/description.h"
#include "robot/parameter_distribution.h"

namespace plumb {

/// The calibrator without its sockets: takes the messages of a live run, of lcm-logplayer or of a
/// log file, and says when an iteration's roll-outs are complete. What it computes depends on the
/// messages' contents only: roll-outs are delimited by CONTROLLER_STATUS (phase COMPLETE, purpose
/// CALIBRATE) and joined when every state they name has arrived, in whatever order the channels
/// interleave. Not thread-safe.
class Calibrator {
 public:
  Calibrator(const RobotDescription& robot, SimOpt& simopt) : simopt_(simopt), joiner_(robot) {}

  void OnState(const robot_state_t& smoothed) { joiner_.OnState(smoothed); }
  void OnCommand(const joint_command_t& command);
  void OnControllerStatus(const controller_status_t& status);

  /// True when the roll-outs of the next iteration have been received whole.
  bool ready() const;
  /// Takes them and begins the iteration in SimOpt. @return the number of usable transitions.
  size_t Begin();

  /// Transitions of the newest roll-out under way that have arrived since the last call. It may
  /// turn out that some of them cannot be used, or more can: what counts is what Begin takes.
  Rollout TakeArrived();

  const DropCounts& drops() const { return joiner_.drops(); }

 private:
  SimOpt& simopt_;
  TransitionJoiner joiner_;
  std::optional<controller_status_t> complete_;
  bool rolling_out_ = false;
  int64_t newest_episode_ = -1;
};

/// SimOpt's distribution over the robot's simulators, as the iterations completed so far have it:
/// with starts of their roll-outs alone. Thread-safe.
ParameterDistribution DistributionOf(const RobotDescription& robot, const SimOpt::State& state);
/// The same as a message. @param report of the iteration that led there; null for the
/// prior.
parameter_distribution_t DistributionMessage(const RobotDescription& robot,
                                             const SimOpt::State& state, uint64_t seed,
                                             const CalibrationReport* report);
/// The findings of an iteration, to be written as posterior.json. @param report of the iteration
/// that `simopt` has completed last.
Findings IterationFindings(const RobotDescription& robot, const SimOpt& simopt,
                           const CalibrationReport& report);
/// Progress and findings as a message. @param stream of transitions that have arrived since, null
/// if there is none.
calibration_status_t StatusMessage(const RobotDescription& robot, const SimOpt::State& state,
                                   const DropCounts& drops, const CalibrationReport* report,
                                   double seconds, const StreamingLaplace* stream = nullptr);

}  // namespace plumb
