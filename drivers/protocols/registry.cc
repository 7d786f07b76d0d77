#include "drivers/protocols/registry.h"

#include <fmt/format.h>

#include <stdexcept>
#include <string_view>
#include <vector>

#include "drivers/protocols/cansimple_device.h"
#include "drivers/protocols/cansimple_host.h"
#include "drivers/protocols/cia406_device.h"
#include "drivers/protocols/cia406_host.h"
#include "drivers/protocols/mit_device.h"
#include "drivers/protocols/mit_host.h"
#include "drivers/protocols/moteus_device.h"
#include "drivers/protocols/moteus_host.h"
#include "drivers/protocols/rmd_device.h"
#include "drivers/protocols/rmd_host.h"
#include "drivers/protocols/xsens_device.h"
#include "drivers/protocols/xsens_host.h"

namespace plumb {
namespace {

struct MotorProtocol {
  std::string_view name;
  std::unique_ptr<Motor> (*make)(const MotorDescription&, const MotorTiming&);
  BusDevice (*bus_device)(const MotorDescription&, const DriverSettings&);
  std::unique_ptr<MotorDevice> (*make_device)(const MotorDescription&, const DriverSettings&,
                                              const VirtualRobotSettings&);
};
constexpr MotorProtocol kMotors[] = {
    {"cansimple", &MakeCanSimpleMotor, &CanSimpleBusDevice, &MakeCanSimpleDevice},
    {"moteus", &MakeMoteusMotor, &MoteusBusDevice, &MakeMoteusDevice},
    {"mit", &MakeMitMotor, &MitBusDevice, &MakeMitDevice},
    {"rmd", &MakeRmdMotor, &RmdBusDevice, &MakeRmdDevice},
};

struct SensorProtocol {
  std::string_view name;
  std::unique_ptr<Sensor> (*make)(const SensorDescription&, const SensorTiming&);
  BusDevice (*bus_device)(const SensorDescription&);
  std::unique_ptr<SensorDevice> (*make_device)(const SensorDescription&);
};
constexpr SensorProtocol kSensors[] = {
    {"cia406", &MakeCia406Encoder, &Cia406BusDevice, &MakeCia406Device},
    {"xsens", &MakeXsensImu, &XsensBusDevice, &MakeXsensDevice},
};

/// @param unknown how the message begins if there is none of that name.
template <class Protocol, size_t count>
const Protocol& Find(const Protocol (&protocols)[count], std::string_view name,
                     std::string_view unknown) {
  std::string known;
  for (const Protocol& protocol : protocols) {
    if (name == protocol.name) return protocol;
    known += (known.empty() ? "" : ", ") + std::string(protocol.name);
  }
  throw std::invalid_argument(fmt::format("{} '{}'; known: {}", unknown, name, known));
}

const MotorProtocol& Of(const MotorDescription& motor) {
  return Find(kMotors, motor.protocol, "unknown motor protocol");
}
const SensorProtocol& Of(const SensorDescription& sensor) {
  return Find(kSensors, sensor.protocol, "unknown sensor protocol");
}

template <class Protocol, size_t count>
std::vector<std::string> Names(const Protocol (&protocols)[count]) {
  std::vector<std::string> names;
  names.reserve(count);
  for (const Protocol& protocol : protocols) names.emplace_back(protocol.name);
  return names;
}

}  // namespace

std::vector<std::string> MotorProtocols() { return Names(kMotors); }

std::vector<std::string> SensorProtocols() { return Names(kSensors); }

std::unique_ptr<Motor> MakeMotor(const MotorDescription& description, const MotorTiming& timing) {
  return Of(description).make(description, timing);
}

BusDevice MotorBusDevice(const MotorDescription& description, const DriverSettings& driver) {
  return Of(description).bus_device(description, driver);
}

std::unique_ptr<MotorDevice> MakeMotorDevice(const RobotDescription& robot, int joint) {
  const JointDescription& driven = robot.joints[static_cast<size_t>(joint)];
  return Find(kMotors, driven.motor.protocol,
              "joint '" + driven.name + "': no virtual drive speaks")
      .make_device(driven.motor, robot.driver, robot.virtual_robot);
}

std::unique_ptr<Sensor> MakeSensor(const SensorDescription& description,
                                   const SensorTiming& timing) {
  if (timing.timeout <= 0) throw std::invalid_argument("a sensor's timeout must be positive");
  return Of(description).make(description, timing);
}

BusDevice SensorBusDevice(const SensorDescription& description) {
  BusDevice device = Of(description).bus_device(description);
  device.name = description.name;
  return device;
}

std::unique_ptr<SensorDevice> MakeSensorDevice(const SensorDescription& description) {
  return Find(kSensors, description.protocol,
              "sensor '" + description.name + "': no virtual sensor speaks")
      .make_device(description);
}

}  // namespace plumb
