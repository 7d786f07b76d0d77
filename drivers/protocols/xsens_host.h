#pragma once

#include "drivers/protocols/sensor.h"

namespace plumb {

/// The driver's side of an Xsens MTi (see xsens.h), configured to send SampleTime, StatusWord,
/// Quaternion, RateOfTurn and Acceleration; GroupCounter is taken into account if it comes, other
/// messages are let pass.
///
/// The messages of one instant are sent in the order of their ids, SampleTime first; they carry no
/// other sign that they belong together. So a sample begins with SampleTime, is given out when all
/// five have come, and is thrown away if one comes twice, if the next SampleTime comes first, or if
/// a part comes more than three quarters of a period later: parts of two samples are never mixed
/// unless several frames of both were lost. A SampleTime that goes back, and an Error message, are
/// faults until Start. It is never told anything.
/// @throws std::invalid_argument if base is not in [0, 0x7FF - 0x7F], or period or tick are not
/// positive. Thread-safe.
std::unique_ptr<Sensor> MakeXsensImu(const SensorDescription& description,
                                     const SensorTiming& timing);

BusDevice XsensBusDevice(const SensorDescription& description);

}  // namespace plumb
