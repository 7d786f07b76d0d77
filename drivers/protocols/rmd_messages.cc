// Of rmd_host.h: the messages on the bus, for plans and DBC files.

#include "common/time_units.h"
#include "drivers/protocols/rmd.h"
#include "drivers/protocols/rmd_host.h"

namespace plumb {

using namespace rmd;

BusDevice RmdBusDevice(const MotorDescription& motor, const DriverSettings& driver) {
  using Direction = BusMessage::Direction;
  const auto node = static_cast<uint32_t>(motor.node);
  const int64_t cycle = Microseconds(driver.cycle), telemetry = Microseconds(driver.telemetry);
  const uint32_t motion = kMotionCommands + node, motion_answer = kMotionAnswers + node;
  BusDevice device{.name = "",
                   .protocol = "rmd",
                   .messages = {},
                   .claims = {{motion, motion}, {motion_answer, motion_answer}},
                   .obeys = {motion}};
  const auto add = [&](const Layout& layout, Direction direction, int64_t period) -> BusMessage& {
    BusMessage& message = device.messages.emplace_back();
    message.layout = layout;
    message.id = (direction == Direction::kToDevice ? kCommands : kAnswers) + node;
    message.direction = direction;
    message.period = period;
    message.selector = layout.command;
    if (direction == Direction::kToDevice) message.jitter = BusMessage::kHostJitter;
    return message;
  };
  // A question and its answer.
  const auto exchange = [&](const Layout& question, const Layout& answer, int64_t period,
                            bool polled) {
    add(question, Direction::kToDevice, period).polled = polled;
    const int index = static_cast<int>(device.messages.size()) - 1;
    BusMessage& reply = add(answer, Direction::kFromDevice, period);
    reply.polled = polled;
    reply.answers = index;
  };
  exchange(kTorque, kTorqueAnswer, cycle, false);
  exchange(Bare(kAskAngle, "Ask_Angle"), kAngle, cycle, false);
  exchange(Bare(kAskStatus, "Ask_Status"), kStatus, telemetry, true);
  exchange(Bare(kAskUptime, "Ask_Uptime"), kUptime, telemetry, true);
  exchange(Bare(kAskVersion, "Ask_Version"), kVersion, telemetry, true);
  exchange(Bare(kAskModel, "Ask_Model"), kModel, telemetry, true);
  exchange(Bare(kAskMotion, "Ask_Motion"), kMotion, 0, false);
  exchange(Bare(kShutdown, "Shutdown"), Bare(kShutdown, "Shutdown_Answer"), 0, false);
  exchange(Bare(kLockBrake, "Lock_Brake"), Bare(kLockBrake, "Lock_Brake_Answer"), 0, false);
  exchange(Bare(kReleaseBrake, "Release_Brake"), Bare(kReleaseBrake, "Release_Brake_Answer"), 0,
           false);
  exchange(kWatchdog, Bare(kSetWatchdog, "Watchdog_Answer"), 0, false);
  add(Bare(kInterrupted, "Interrupted"), Direction::kFromDevice, 0);
  // To all motors at once; we do not send it, but nobody else may.
  BusMessage& all = add(Bare(kShutdown, "Shutdown_All"), Direction::kToDevice, 0);
  all.id = kAllMotors;
  all.shared = true;
  all.selector = -1;
  return device;
}

}  // namespace plumb
