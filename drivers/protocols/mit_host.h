#pragma once

#include "drivers/protocols/bus_device.h"
#include "drivers/protocols/motor.h"

namespace plumb {

/// The host's side of a motor that speaks the MIT mini-cheetah protocol (see mit.h). It is used for
/// torque only: all gains are zero in everything we send.
///
/// A motor speaks only when spoken to, so it is polled: in each Tick at rest with a frame of zero
/// gains and zero torque, every 20 ms while it is silent.
///
/// Arming: three such frames accepted and one answered, because a motor obeys, the instant it is
/// switched on, whatever it was told last -> "enter", twice, since no reply tells whether it has
/// been obeyed -> armed after two more replies without an error. The driver sends zero torque
/// meanwhile; until it is armed, Torque gives zero whatever it is asked for. Disarming, and at the
/// start: "exit" until the second one has been answered.
///
/// The zero of the position is never touched. Replies wrap every 25 rad (of +-12.5): the position
/// is unwrapped, and a step that the greatest velocity does not explain is a fault. After a silence
/// of 0.1 s or heartbeat_timeout it has lost its place, unless it is where it was. At the start it
/// is taken to be within +-12.5 rad.
/// @throws std::invalid_argument if the node is not in [1, 0xFF], the id of the replies not in [0,
/// 0x7FF] or equal to the node, a range is not positive or missing. Thread-safe.
std::unique_ptr<Motor> MakeMitMotor(const MotorDescription& description, const MotorTiming& timing);

/// A command and a reply, in every cycle.
BusDevice MitBusDevice(const MotorDescription& motor, const DriverSettings& driver);

}  // namespace plumb
