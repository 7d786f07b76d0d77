#pragma once

#include "drivers/protocols/bus_device.h"
#include "drivers/protocols/motor.h"

namespace plumb {

/// The host's side of an RMD motor (see rmd.h). It is given torque currents only, and is asked for
/// its angle in every Tick, behind the setpoint whose answer says how fast it turns; at rest, where
/// there are no setpoints, for its motion as well.
///
/// A motor runs from its first setpoint on: nothing switches it on, and nothing it says tells
/// whether it runs. So no setpoint is sent before Arm and none after Disarm; disarming, and the
/// start, is "shut down" and "lock the brake" until the second of them has been answered, and at
/// rest both are said again every 100 ms.
///
/// Arming: the watchdog's time, once for as long as this object lives, since each wears the motor's
/// flash, and a report without errors -> the brake is released -> armed after two more setpoints of
/// zero have been answered. The driver sends those meanwhile; until it is armed, Torque gives zero
/// whatever it is asked for.
///
/// A motor whose watchdog has expired echoes the next command and ignores it: an echo of the
/// question for the angle reads as an angle of 0, one of a setpoint as zeros, too; and it obeys the
/// one after that as if nothing had happened. Therefore what comes first after a silence of the
/// watchdog's time is not read, and such a silence of an armed motor is a fault.
///
/// Angles count turns, and do not wrap; a motor may have lost them, or others, with its power. Its
/// time since it was switched on tells of that: until a person has homed it, its place is lost.
/// @throws std::invalid_argument if the node is not in [1, 32], or its settings are missing or not
/// positive. Thread-safe.
std::unique_ptr<Motor> MakeRmdMotor(const MotorDescription& description, const MotorTiming& timing);

/// Setpoint and angle with their answers in every cycle; status, uptime, version and model in turn.
BusDevice RmdBusDevice(const MotorDescription& motor, const DriverSettings& driver);

}  // namespace plumb
