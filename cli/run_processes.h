#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cli/child.h"
#include "cli/launch.h"
#include "common/lockstep/coordinator.h"
#include "robot/settings/driver.h"

namespace plumb {

/// The processes of a run: started together, and stopped in the order that is safe. Not
/// thread-safe.
class RunProcesses {
 public:
  struct Where {
    std::vector<std::string> buses;  ///< values of their option --bus
    std::string lcm_url;
    std::string clock;             ///< value of their option --clock
    std::string key_file;          ///< empty = none
    int64_t run;                   ///< value of their option --run
    std::filesystem::path output;  ///< for their logs and checkpoints
  };

  /// @param coordinator of a run in virtual time; null in real time.
  RunProcesses(const LaunchFlags& flags, Where where, const DriverSettings& driver,
               Coordinator* coordinator)
      : flags_(flags),
        where_(std::move(where)),
        disarm_patience_(DisarmPatience(driver)),
        coordinator_(coordinator) {}
  ~RunProcesses() { Stop(true); }

  /// @throws std::runtime_error if one cannot be started.
  void Start();
  /// Starts the page before all others, so that it sees all they say, and awaits its address.
  /// @return a line for people: where it is, or why there is none; a run goes on without it.
  std::string StartDashboard();
  /// A process that has ended though nobody has asked it to; null if all run.
  Child* Ended();
  /// Motors first, the virtual robot last. Does not throw. @param hurry whatever they do: within
  /// six seconds, or one if a person waits. Otherwise, in virtual time, always in the same way.
  void Stop(bool hurry) noexcept;
  /// Once they are stopped: why the record of a run in real time is not whole; empty if it is, or
  /// there is none.
  const std::string& record_fault() const { return record_fault_; }
  /// A person waits for the end.
  void Hurry() { patience_ = 0.5; }

 private:
  void Start(const std::string& name, std::vector<std::string> arguments);
  std::vector<std::string> Command(const std::string& name, std::vector<std::string> arguments,
                                   const std::string& clock) const;
  void StopInVirtualTime(bool hurry);
  void StopInRealTime();

  const LaunchFlags& flags_;
  const Where where_;
  const double disarm_patience_;  // [s]
  Coordinator* coordinator_;
  double patience_ = 5;  // [s] of real time for the motors to be switched off in virtual time
  std::vector<Child> children_;
  std::string record_fault_;
  std::optional<Child> dashboard_;  // looks on, in virtual time from outside
};

}  // namespace plumb
