#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <optional>
#include <string>

#include "cli/folder_lock.h"
#include "cli/launch.h"
#include "cli/virtual_run.h"
#include "common/name_lock.h"
#include "common/process.h"
#include "robot/description.h"

namespace plumb {

/// A run's settings, checked before anything starts. Not thread-safe.
struct RunSetting {
  /// Makes the run's folder and locks it.
  /// @throws std::invalid_argument or std::runtime_error, one line for people: a robot that cannot
  /// be driven, commands that strangers could give, a bus or LCM in use, a folder in use.
  RunSetting(const Process& process, const LaunchFlags& flags);

  /// Null in real time.
  Coordinator* coordinator() { return virtual_run ? &virtual_run->coordinator() : nullptr; }

  RobotDescription robot;  ///< with the buses' URLs as the flags have them
  int64_t run;  ///< its number among all runs, see Identity; 0 in virtual time, which is alone
  Eigen::VectorXd truth;         ///< hidden parameters, physical; empty: nobody knows them
  std::filesystem::path output;  ///< the run's folder
  std::optional<FolderLock> lock;
  std::deque<NameLock> locks;             ///< messages and buses
  std::optional<VirtualRun> virtual_run;  ///< none in real time

 private:
  void Lock(const std::string& lcm_url);
};

}  // namespace plumb
