// Of mit_host.h: the messages on the bus, for plans and DBC files.

#include "common/time_units.h"
#include "drivers/protocols/mit.h"
#include "drivers/protocols/mit_host.h"

namespace plumb {

BusDevice MitBusDevice(const MotorDescription& motor, const DriverSettings& driver) {
  const MitDescription mit = motor.mit.value_or(MitDescription{});
  const int64_t cycle = Microseconds(driver.cycle);
  BusDevice device{.name = "", .protocol = "mit", .messages = {}, .claims = {}};
  BusMessage command;
  command.layout = mit::CommandLayout(mit.ranges);
  command.id = static_cast<uint32_t>(motor.node);
  command.direction = BusMessage::Direction::kToDevice;
  command.period = cycle;
  command.jitter = BusMessage::kHostJitter;
  BusMessage reply;
  reply.layout = mit::ReplyLayout(mit.ranges, mit::kWithTemperature);
  reply.id = static_cast<uint32_t>(mit.master);
  reply.period = cycle;
  reply.answers = 0;
  reply.shared = true;
  reply.selector = motor.node;
  device.messages = {command, reply};
  return device;
}

}  // namespace plumb
