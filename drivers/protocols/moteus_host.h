#pragma once

#include "drivers/protocols/bus_device.h"
#include "drivers/protocols/motor.h"

namespace plumb {

/// The host's side of a moteus (see moteus.h). It is used for torque only: position mode with
/// scales of 0 for all its gains and no position, feed-forward torque, the greatest torque of
/// robot.toml, and the time for which the command holds. Behind every command, and alone at rest,
/// goes the question for all that moves, for mode, fault, voltage and temperatures.
///
/// One frame a cycle, never two: the motor drops an answer that it has not yet sent for the next
/// one (FDCan::Send in its firmware).
///
/// Arming: "stop", which clears faults and leads out of a timeout, with the questions for firmware,
/// register map and servo.timeout_mode behind it, until all are answered; Torque gives these
/// frames, too, while the driver asks for zeros -> commands of zero torque until two answers say
/// position mode -> armed. A motor that brakes or holds when its commands stay away, instead of
/// letting go, is refused, for then the end of the driver would not be the end of the torque.
///
/// Disarming, and the start: "stop" until an answer to the second one says stopped. The mode is in
/// every answer: one that is not position mode, of an armed motor, is a fault with the motor's own
/// reason; one that moves, of a motor at rest, is told to stop again. A silence of the time for
/// which commands hold is a fault, too.
///
/// It does not count turns beyond its power: one that has restarted has lost its place until a
/// person has homed it. The place is never written, nor any setting.
/// @throws std::invalid_argument if the node is not in [1, 126], or its settings are missing or not
/// positive. Thread-safe.
std::unique_ptr<Motor> MakeMoteusMotor(const MotorDescription& description,
                                       const MotorTiming& timing);

/// A command and an answer in every cycle.
BusDevice MoteusBusDevice(const MotorDescription& motor, const DriverSettings& driver);

}  // namespace plumb
