// Of moteus_host.h: the messages on the bus, for plans and DBC files.

#include "common/time_units.h"
#include "drivers/protocols/moteus.h"
#include "drivers/protocols/moteus_host.h"

namespace plumb {

using namespace moteus;

BusDevice MoteusBusDevice(const MotorDescription& motor, const DriverSettings& driver) {
  using Direction = BusMessage::Direction;
  const auto node = static_cast<uint32_t>(motor.node);
  BusDevice device{.name = "", .protocol = "moteus", .messages = {}, .claims = {}};
  const auto add = [&](const Layout& layout, uint32_t id, Direction direction) -> BusMessage& {
    BusMessage& message = device.messages.emplace_back();
    message.layout = layout;
    message.id = id;
    message.extended = id > 0x7FF;
    message.fd = true;
    message.direction = direction;
    if (direction == Direction::kToDevice) message.sender_bits = kSourceBits;
    return message;
  };
  BusMessage& command = add(kCommand.layout, CommandId(motor.node), Direction::kToDevice);
  command.period = Microseconds(driver.cycle);
  command.jitter = BusMessage::kHostJitter;
  BusMessage& answer = add(kAnswer.layout, AnswerId(motor.node), Direction::kFromDevice);
  answer.period = Microseconds(driver.cycle);
  answer.answers = 0;
  // At rest, and while arming.
  add({0, "Question", 12}, CommandId(motor.node), Direction::kToDevice);
  add({0, "Stop", 48}, CommandId(motor.node), Direction::kToDevice);
  add({0, "Text", 64}, AnswerId(motor.node), Direction::kFromDevice);
  // To all at once; we do not send it, but nobody else may.
  add({0, "All", 48}, CommandId(kEverybody), Direction::kToDevice).shared = true;
  // Its hardware lets in, and obeys, every frame whose id ends with its number, and of the standard
  // ones without being asked for an answer.
  for (uint32_t source = 0; source <= 7; ++source)
    device.claims.push_back({source << 8 | node, source << 8 | node});
  return device;
}

}  // namespace plumb
