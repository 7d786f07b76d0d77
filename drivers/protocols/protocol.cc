#include "drivers/protocols/protocol.h"

#include <stdexcept>

#include "drivers/protocols/cansimple_host.h"

namespace plumb {
namespace {

struct Protocol {
  std::string_view name;
  std::unique_ptr<Motor> (*make)(const MotorDescription&, const MotorTiming&);
};

/// A new motor is one file pair and one line here.
constexpr Protocol kProtocols[] = {
    {"cansimple", &MakeCanSimpleMotor},
};

}  // namespace

std::unique_ptr<Motor> MakeMotor(const MotorDescription& description, const MotorTiming& timing) {
  std::string known;
  for (const Protocol& protocol : kProtocols) {
    if (description.protocol == protocol.name) return protocol.make(description, timing);
    known += (known.empty() ? "" : ", ") + std::string(protocol.name);
  }
  throw std::invalid_argument(
      fmt::format("unknown motor protocol '{}'; known: {}", description.protocol, known));
}

}  // namespace plumb
