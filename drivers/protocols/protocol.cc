#include "drivers/protocols/protocol.h"

#include <fmt/format.h>

#include <stdexcept>

#include "drivers/protocols/cansimple_host.h"
#include "drivers/protocols/mit_host.h"

namespace plumb {
namespace {

struct Protocol {
  std::string_view name;
  std::unique_ptr<Motor> (*make)(const MotorDescription&, const MotorTiming&);
  BusDevice (*bus_device)(const MotorDescription&, const DriverSettings&);
};

/// A new motor is a few files and one line here.
constexpr Protocol kProtocols[] = {
    {"cansimple", &MakeCanSimpleMotor, &CanSimpleBusDevice},
    {"mit", &MakeMitMotor, &MitBusDevice},
};

const Protocol& Find(std::string_view name) {
  std::string known;
  for (const Protocol& protocol : kProtocols) {
    if (name == protocol.name) return protocol;
    known += (known.empty() ? "" : ", ") + std::string(protocol.name);
  }
  throw std::invalid_argument(fmt::format("unknown motor protocol '{}'; known: {}", name, known));
}

}  // namespace

std::unique_ptr<Motor> MakeMotor(const MotorDescription& description, const MotorTiming& timing) {
  return Find(description.protocol).make(description, timing);
}

BusDevice MotorBusDevice(const MotorDescription& description, const DriverSettings& driver) {
  return Find(description.protocol).bus_device(description, driver);
}

}  // namespace plumb
