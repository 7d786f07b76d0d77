#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "calibrator/results/calibration.h"
#include "common/process.h"

namespace plumb {

/// The flags of `plumb calibrate`.
struct CalibrateFlags {
  std::string robot;
  std::vector<std::string> logs, tables;  ///< LCM logs, CSV files
  CalibrationOptions options;
  int threads = 0;  ///< 0 = one per core
  std::string output = "posterior.json";
  std::string report, urdf;  ///< files; empty = none
  int sbc = 0;               ///< runs of simulation-based calibration instead; 0 = none
  bool strict = false;       ///< exit status 3 if the findings should not be trusted
  std::string model;         ///< address of somebody else's simulator; empty = ours
  std::string model_name = "next_states";
};

/// The methods' part of --help: a line for each. Thread-safe.
std::string MethodHelp();

/// `plumb calibrate`: infers from logs which simulators could have produced the robot's motion,
/// writes the posterior, and summarises it for people. With mpirun its ranks share the work. An
/// interrupted run leaves a journal beside the output, from which the same command goes on. @return
/// exit status: 0, 130 if it was interrupted; with `strict` 3 if the findings are not Trustworthy.
/// @throws std::invalid_argument or std::runtime_error, one line for people: robot, logs, files.
/// With a `model` it is that simulator's parameters that are inferred: CalibrateRemote. With `sbc`
/// posteriors are judged, and nothing is written: JudgePosteriors. Both are for one rank.
/// Has threads of its own; call it from one.
int CalibrateLogs(Process& process, CalibrateFlags flags, const std::string& command);

}  // namespace plumb
