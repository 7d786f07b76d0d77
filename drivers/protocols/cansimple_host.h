#pragma once

#include "drivers/protocols/bus_device.h"
#include "drivers/protocols/motor.h"

namespace plumb {

/// The host's side of an ODrive with firmware 0.6 (see cansimple.h).
///
/// Arming: heartbeat heard -> Get_Version asked and found to be 0.6 (0.5 uses the same ids for
/// other things) -> Clear_Errors -> Set_Controller_Mode torque, passthrough, twice ->
/// Set_Axis_State closed loop -> armed when a heartbeat says so without an error. One step per
/// Tick, because the kernel holds few frames in flight; frames that the transport did not take are
/// given again before the next step. The drive cannot be asked for its mode, so a mode that is lost
/// on the bus goes unnoticed: hence twice, in two Ticks, the second time in front of the order to
/// run, lest a drive that restarts in between runs in the mode it wakes up in. The driver sends
/// zero torque meanwhile, which feeds the drive's watchdog.
/// Thread-safe. @throws std::invalid_argument if the node is not in [0, 0x3E].
std::unique_ptr<Motor> MakeCanSimpleMotor(const MotorDescription& description,
                                          const MotorTiming& timing);

/// The messages between such a drive and its host, the drive configured to send heartbeats with a
/// fifth of heartbeat_timeout and encoder estimates with `measurement`; all else on request,
/// temperatures and its supply every `telemetry`.
BusDevice CanSimpleBusDevice(const MotorDescription& motor, const DriverSettings& driver);

}  // namespace plumb
