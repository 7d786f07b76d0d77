#pragma once

#include <cstdint>
#include <string>

#include "common/process.h"

namespace plumb {

/// The flags of `plumb train`.
struct TrainFlags {
  std::string robot;
  /// a posterior.json, "prior" or "nominal" (the prior's means)
  std::string distribution = "prior";
  double steps = 0;  ///< simulated; 0 = what the robot's settings ask for
  uint64_t seed = 1;
  int threads = 0;  ///< 0 = one per core
  std::string output = "policy.onnx";
  std::string checkpoint;  ///< file; empty = output + ".checkpoint"
  std::string csv;         ///< file; empty = none, with a report the report's name and .csv
  std::string report;      ///< file; empty = none
  std::string command;     ///< as it was given, for the report
  /// a policy or checkpoint to begin with; empty = from scratch
  std::string from;
  bool paper = false;      ///< see PaperSettings
  double worst_share = 0;  ///< 0 = the robot's setting
  int worst_after = -1;    ///< updates; negative = the robot's setting
  int evaluate_every = 0;  ///< updates; 0 = never
  int held_out = 100;      ///< simulators
};

/// `plumb train`: trains a policy on simulators drawn from a distribution, without any other
/// process, and says how it does on simulators held out. An interrupted run leaves a checkpoint,
/// from which the same command goes on to the same bits.
/// @return exit status: 0; or 130 if it was interrupted, which ends the process at once while it
/// looks how the policy does. Has threads of its own; call it from one.
/// @throws std::invalid_argument or std::runtime_error, one line for people: robot, distribution,
/// files, simulations that cannot be used.
int Train(Process& process, TrainFlags flags);

}  // namespace plumb
