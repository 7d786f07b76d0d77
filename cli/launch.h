#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/process.h"

namespace plumb {

/// In a run's folder: where calibrator and trainer keep their checkpoints.
inline constexpr char kCalibrationFolder[] = "calibration", kTrainingFolder[] = "training";

/// The flags of `plumb launch`. At most one of `efforts` and `policy`.
struct LaunchFlags {
  std::string robot = "robots/pendulum";
  uint64_t seed = 1;
  int iterations = 8;
  int evaluation_episodes = 10;
  /// table of efforts to play once and calibrate with, without any policy; empty = the whole loop
  std::string efforts;
  /// file of a policy to run, without learning anything; empty = the whole loop
  std::string policy;
  std::vector<std::string> buses;  ///< see SetUrls; empty = the robot's own
  bool real_time = false;  ///< a virtual robot in real time; otherwise it runs in virtual time
  /// in real time scaled seconds per second, 0 = 1; in virtual time the most, 0 = no limit
  double speed = 0;
  bool real = false;  ///< the robot is on the bus: start no virtual one, ask before arming
  bool allow_unsigned = false;  ///< although LCM leaves this machine
  /// SCHED_FIFO of the driver; robot, estimator and controller come right behind it. 0 = off
  int priority = 0;
  std::string log;         ///< record all messages here; empty = do not
  bool overwrite = false;  ///< what the log holds that cannot be made again
  std::string can_log;     ///< record all frames here, in virtual time; empty = do not
  std::string summary;     ///< JSON of the outcome; empty = do not
  std::string report;      ///< the same as an HTML page; empty = do not
  /// where a page shows the run, ADDRESS:PORT; empty: nowhere
  std::string dashboard;
  std::vector<std::string> origins;  ///< of other pages that may talk to that one
  std::string command;               ///< that was given
  std::string output;                ///< folder for logs and checkpoints; empty = a new one
};

/// `plumb launch`: starts every process of a run, arms, shows progress, stops everything again
/// whatever happens: motors first, the virtual robot last, within a second. @return exit status: 0
/// finished, 1 something failed, 130 interrupted. Runs in one thread; the work is done by
/// processes.
/// @throws std::invalid_argument or std::runtime_error, one line for people, if it cannot begin.
int Launch(Process& process, const LaunchFlags& flags);

}  // namespace plumb
