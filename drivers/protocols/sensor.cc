#include "drivers/protocols/sensor.h"

#include <stdexcept>

#include "drivers/protocols/cia406_host.h"
#include "drivers/protocols/xsens_host.h"

namespace plumb {
namespace {

struct Protocol {
  std::string_view name;
  std::unique_ptr<Sensor> (*make)(const SensorDescription&, const SensorTiming&);
  BusDevice (*bus_device)(const SensorDescription&);
};

/// A new sensor is a few files and one line here.
constexpr Protocol kProtocols[] = {
    {"cia406", &MakeCia406Encoder, &Cia406BusDevice},
    {"xsens", &MakeXsensImu, &XsensBusDevice},
};

const Protocol& Find(std::string_view name) {
  std::string known;
  for (const Protocol& protocol : kProtocols) {
    if (name == protocol.name) return protocol;
    known += (known.empty() ? "" : ", ") + std::string(protocol.name);
  }
  throw std::invalid_argument(fmt::format("unknown sensor protocol '{}'; known: {}", name, known));
}

}  // namespace

std::unique_ptr<Sensor> MakeSensor(const SensorDescription& description,
                                   const SensorTiming& timing) {
  if (timing.timeout <= 0) throw std::invalid_argument("a sensor's timeout must be positive");
  return Find(description.protocol).make(description, timing);
}

BusDevice SensorBusDevice(const SensorDescription& description) {
  BusDevice device = Find(description.protocol).bus_device(description);
  device.name = description.name;
  return device;
}

}  // namespace plumb
