// Of cansimple_host.h: the messages on the bus, for plans and DBC files.

#include "common/time_units.h"
#include "drivers/protocols/cansimple.h"
#include "drivers/protocols/cansimple_host.h"

namespace plumb {

using namespace cansimple;

BusDevice CanSimpleBusDevice(const MotorDescription& motor, const DriverSettings& driver) {
  using Direction = BusMessage::Direction;
  const auto block = static_cast<uint32_t>(motor.node) << 5;
  const int64_t heartbeat = Microseconds(driver.heartbeat_timeout) / kBeatsPerTimeout;
  const int64_t telemetry = Microseconds(driver.telemetry);
  BusDevice device{
      .name = "", .protocol = "cansimple", .messages = {}, .claims = {{block, block + 0x1F}}};
  const auto add = [&](const Layout& layout, Direction direction, int64_t period) {
    BusMessage message;
    message.layout = layout;
    message.id = block | layout.command;
    message.direction = direction;
    message.period = period;
    if (direction == Direction::kToDevice) message.jitter = BusMessage::kHostJitter;
    device.messages.push_back(message);
  };
  add(kHeartbeat, Direction::kFromDevice, heartbeat);
  add(kGetEncoderEstimates, Direction::kFromDevice, Microseconds(driver.measurement));
  for (const Layout& layout : kPolledReports) {
    add(layout, Direction::kToDevice, telemetry);
    device.messages.back().remote = device.messages.back().polled = true;
    const int question = static_cast<int>(device.messages.size()) - 1;
    add(layout, Direction::kFromDevice, telemetry);
    device.messages.back().polled = true;
    device.messages.back().answers = question;
  }
  for (const Layout& layout : {kGetVersion, kGetError, kAddress, kGetTorques, kGetIq, kGetPowers}) {
    add(layout, Direction::kFromDevice, 0);
  }
  add(kSetInputTorqueShort, Direction::kToDevice, Microseconds(driver.cycle));
  for (const Layout& layout : {kEstop, kSetAxisState, kSetControllerMode, kClearErrors}) {
    add(layout, Direction::kToDevice, 0);
  }
  // To all drives at once; we send neither, but nobody else may.
  for (const Layout& layout : {kEstop, kAddress}) {
    add(layout, Direction::kToDevice, 0);
    device.messages.back().id = static_cast<uint32_t>(kBroadcastNode) << 5 | layout.command;
    device.messages.back().shared = true;
    device.messages.back().remote = layout.command == kAddress.command;
  }
  for (const uint8_t command : kOtherCommands) device.obeys.push_back(block | command);
  return device;
}

}  // namespace plumb
