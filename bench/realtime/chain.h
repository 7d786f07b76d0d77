#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "bench/realtime/chain_robot.h"
#include "bench/realtime/floor.h"

namespace plumb {

/// Times measured along a chain.
struct ChainTimes {
  /// Of the driver's cycles, from DRIVER_STATUS: bin i counts lateness in [2^i, 2^(i+1)) us, the
  /// first from 0, the last without end.
  std::vector<int64_t> lateness;
  int64_t cycles = 0, overruns = 0;
  /// From an encoder frame to the first torque frame that carries the command which answers it,
  /// both as the kernel stamped them when they came to a listener on the bus. Which command answers
  /// which frame is known from LCM: JOINT_COMMAND.state_sequence is the JOINT_STATE's sequence,
  /// whose position and velocity are the frame's.
  Times answers;
  int64_t commands = 0;  ///< of the policy, in that time
  /// of these, never on the bus: a newer one came within the driver's cycle
  int64_t superseded = 0;
  int stops = 0;       ///< times the robot had stopped and was armed again
  std::string reason;  ///< of the last one
};

/// Runs plumb-robot, plumb-driver, plumb-estimator and plumb-controller on udp: buses (control
/// every 10 ms), and listens for `seconds` from the first torque on. Of several buses it listens to
/// the first one. Not thread-safe.
/// @param priority the driver's --realtime-priority.
/// @param load processes that keep the cores busy meanwhile.
/// @throws std::runtime_error if no torque is seen within a minute.
ChainTimes MeasureChain(const std::string& source, const std::string& binaries, ChainRobot robot,
                        double seconds, int priority, int load);

}  // namespace plumb
