#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <string>
#include <string_view>
#include <vector>

#include "common/clock.h"
#include "common/messenger.h"
#include "common/process.h"
#include "drivers/can/transport.h"
#include "drivers/driver/driver.h"
#include "drivers/driver/phase_times.h"
#include "drivers/driver/state_log.h"
#include "drivers/robot_bus.h"
#include "plumb/driver_request_t.hpp"
#include "plumb/driver_status_t.hpp"
#include "plumb/imu_t.hpp"
#include "plumb/joint_command_t.hpp"
#include "plumb/joint_state_t.hpp"
#include "robot/description.h"

namespace plumb {

/// The driver between a robot's buses and LCM: waits for frames, messages and its cycle's deadline,
/// gives them to Driver, and sends what that has to say. Not thread-safe.
class DriverProcess {
 public:
  /// Opens the buses. @param flight_recorder folder, see OpenBuses. @param is_virtual the robot is
  /// plumb-robot. @throws std::runtime_error, see OpenBuses and Process::messenger.
  DriverProcess(Process& process, const RobotDescription& robot, const std::string& flight_recorder,
                bool is_virtual);

  /// Until the process is asked to stop; whatever ends it, drives are disarmed first.
  /// @return the exit status, see DisarmAndStop. @throws whatever has failed.
  int Run();

 private:
  /// Waits for input or the cycle's deadline, and deals with what there is.
  void Step();
  void OnCommand(const joint_command_t& command);
  void OnRequest(const driver_request_t& request);
  void OnForgedRequest(const driver_request_t& request, std::string_view why);
  /// @return whether there were any.
  bool ReceiveFrames();
  bool ReceiveFrames(size_t index);
  /// @return whether there was anything to say.
  bool Publish();
  void Cycle();
  /// Tries to bring back what is down.
  void Reopen(int64_t now);
  void PublishStatus();
  /// Zero torque and idle drives, confirmed by their heartbeats. @return 1 if a drive that may be
  /// armed has not confirmed it in time, else 0: one that was never there has nothing to confirm.
  int DisarmAndStop(std::string_view why);

  Process& process_;
  const Clock& clock_;
  Driver driver_;
  std::deque<RobotBus> buses_;         // in the robot's order
  std::vector<int> fds_, accepted_;    // of each bus; frames accepted in this cycle
  std::vector<TransportStats> stats_;  // of each bus
  Periodic cycle_;
  Publisher<joint_state_t> states_;
  Publisher<imu_t> imus_;
  Publisher<driver_status_t> statuses_;
  Subscriber<joint_command_t> commands_;
  Subscriber<driver_request_t> requests_;
  std::array<Frame, 64> received_;
  PhaseTimes phases_{!clock_.is_virtual()};
  // something has failed: nobody on LCM is heard or told any more, the drives come first
  bool deaf_ = false;
  int64_t next_reopen_ = 0;
  int64_t next_status_ = 0;
  uint64_t revision_ = 0;
  StateLog log_;             // to stderr
  int64_t disarm_patience_;  // [us] of scaled time, and of real time no less
};

}  // namespace plumb
