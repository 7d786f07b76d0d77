#pragma once

#include <memory>
#include <string>

#include "drivers/protocols/bus_device.h"
#include "drivers/protocols/motor.h"
#include "drivers/protocols/motor_device.h"
#include "drivers/protocols/sensor.h"
#include "drivers/protocols/sensor_device.h"
#include "robot/description.h"

// All protocols by their names in robot.toml. A new one is its own files and a line in registry.cc:
// the driver, the bus plan, the DBC file and the virtual robot find it there. Thread-safe.
namespace plumb {

/// Names of those that are known here.
std::vector<std::string> MotorProtocols();
std::vector<std::string> SensorProtocols();

/// The host's side of a motor (MotorDescription::protocol).
/// @throws std::invalid_argument for an unknown protocol (the message lists those known), or a node
/// or settings it cannot have.
std::unique_ptr<Motor> MakeMotor(const MotorDescription& description, const MotorTiming& timing);

/// The messages of that motor and its host on the bus; without a name.
/// @throws std::invalid_argument for an unknown protocol.
BusDevice MotorBusDevice(const MotorDescription& description, const DriverSettings& driver);

/// The motor itself, as the virtual robot has it. Boot it before use. @param joint index of one
/// with a motor.
/// @throws std::invalid_argument for an unknown protocol or settings it cannot have.
std::unique_ptr<MotorDevice> MakeMotorDevice(const RobotDescription& robot, int joint);

/// The host's side of a sensor (SensorDescription::protocol).
/// @throws std::invalid_argument for an unknown protocol (the message lists those known) or
/// settings it cannot have.
std::unique_ptr<Sensor> MakeSensor(const SensorDescription& description,
                                   const SensorTiming& timing);

/// The messages of that sensor and the driver on the bus, under its name.
/// @throws std::invalid_argument for an unknown protocol.
BusDevice SensorBusDevice(const SensorDescription& description);

/// The sensor itself, as the virtual robot has it. Boot it before use.
/// @throws std::invalid_argument for an unknown protocol or settings it cannot have.
std::unique_ptr<SensorDevice> MakeSensorDevice(const SensorDescription& description);

}  // namespace plumb
