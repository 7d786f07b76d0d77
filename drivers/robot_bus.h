#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "common/name_lock.h"
#include "common/process.h"
#include "drivers/can/transport.h"
#include "drivers/driver/driver.h"
#include "drivers/driver/flight_recorder.h"
#include "robot/description.h"

namespace plumb {

/// [s] before a fault whose frames are kept.
inline constexpr int kFlightSeconds = 2;

/// One of the robot's buses: its end here, and its latest frames.
struct RobotBus {
  RobotBus(const BusDescription& bus, std::unique_ptr<Transport> end, const std::string& folder);

  std::optional<NameLock> lock;  ///< against a second driver on this machine; none in virtual time

  std::unique_ptr<Transport> transport;
  FlightRecorder recorder;
  int64_t faults_dumped = 0;  ///< of Driver::faults, how many it has written the frames before
};

/// Opens them, in the robot's order, for the frames that the driver listens to. @param
/// flight_recorder folder of the frames before a fault; empty = they are not kept.
/// @throws std::runtime_error naming the bus that cannot be opened, lacks the CAN FD it needs, or
/// has another driver of this machine at work.
std::deque<RobotBus> OpenBuses(Process& process, const RobotDescription& robot,
                               const Driver& driver, const std::string& flight_recorder);

}  // namespace plumb
