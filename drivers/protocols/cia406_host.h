#pragma once

#include "drivers/protocols/sensor.h"

namespace plumb {

/// The driver's side of a CANopen absolute encoder (see cia406.h).
///
/// It is told its period (object 1800h:05, in whole milliseconds) and to start, every half second
/// until positions come and it has answered that it took the period. Counts wrap after
/// SensorDescription::range; turns are counted from the first position after Start (and
/// Displaced), which is taken to be within half that range of 0. A fault, until Start: positions
/// that need more than max_speed; a boot-up message or another state than "operational" while
/// running; an emergency message with an error; a refused period; a silence in which it could have
/// turned by half its range. Whatever it sends faster than its period is taken as sampled by it.
/// @throws std::invalid_argument if the node is not in [1, 127], or counts, range, period or speed
/// cannot be. Thread-safe.
std::unique_ptr<Sensor> MakeCia406Encoder(const SensorDescription& description,
                                          const SensorTiming& timing);

BusDevice Cia406BusDevice(const SensorDescription& description);

}  // namespace plumb
