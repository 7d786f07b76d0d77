#include "drivers/robot_bus.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <stdexcept>
#include <utility>

#include "common/time_units.h"

namespace plumb {
namespace {

// of a bus: more than two of 1 Mbit/s carry in that time
constexpr size_t kFlightFrames = size_t{kFlightSeconds} * 20'000;

void ReportFlight(const std::string& file, const std::string& error) {
  if (error.empty())
    spdlog::warn("the frames of the last {} s are in {}", kFlightSeconds, file);
  else
    spdlog::error("the frames before the fault are lost: {}", error);
}

void RequireFd(const BusDescription& bus, const Transport& transport, const std::string& robot) {
  if (bus.data_bit_rate == 0 || transport.carries_fd()) return;
  throw std::runtime_error(fmt::format(
      "{}: the interface is not set up for CAN FD, which {} needs; cure: ip link set CAN type "
      "can bitrate {:.0f} dbitrate {:.0f} fd on, or of a vcan: mtu 72",
      bus.url, robot, bus.bit_rate, bus.data_bit_rate));
}

}  // namespace

RobotBus::RobotBus(const BusDescription& bus, std::unique_ptr<Transport> end,
                   const std::string& folder)
    : transport(std::move(end)), recorder(folder, bus, kFlightFrames, ReportFlight) {}

std::deque<RobotBus> OpenBuses(Process& process, const RobotDescription& robot,
                               const Driver& driver, const std::string& flight_recorder) {
  std::deque<RobotBus> buses;
  for (const BusDescription& bus : robot.buses) {
    auto transport =
        OpenTransport(bus.url, driver.filters(buses.size()),
                      {process.participant(), Microseconds(robot.driver.effort_delay)});
    RequireFd(bus, *transport, robot.name);
    const std::string innermost = InnermostBus(bus.url);
    // Of virtual time, of a recording and within the process each has his own.
    const bool own =
        process.participant() || transport->is_replay() || innermost.starts_with("loop:");
    RobotBus& opened = buses.emplace_back(bus, std::move(transport), flight_recorder);
    if (own) continue;
    opened.lock.emplace("driver on " + innermost, "another driver is at work on " + innermost +
                                                      ": end it, or give another --bus");
  }
  return buses;
}

}  // namespace plumb
