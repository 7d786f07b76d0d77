#include "drivers/bus/bus_collisions.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

namespace plumb {
namespace {

using Direction = BusMessage::Direction;

std::string Verb(const BusMessage& message) {
  return fmt::format("{} {}", message.direction == Direction::kFromDevice ? "sends" : "obeys",
                     message.layout.name);
}

// Both say, or both hear, what their protocol lets several devices say or hear.
bool MayShare(const BusDevice& a, const BusMessage& in_a, const BusDevice& b,
              const BusMessage& in_b) {
  return a.protocol == b.protocol && in_a.shared && in_b.shared &&
         in_a.direction == in_b.direction && (in_a.selector < 0 || in_a.selector != in_b.selector);
}

std::optional<std::string> SameId(const BusDevice& a, const BusDevice& b,
                                  std::vector<std::string>& warnings) {
  for (const BusMessage& in_a : a.messages) {
    for (const BusMessage& in_b : b.messages) {
      if (in_a.id != in_b.id || in_a.extended != in_b.extended) continue;
      if (!MayShare(a, in_a, b, in_b)) {
        return fmt::format("CAN id {:#05x}: '{}' {} and '{}' {}", in_a.id, a.name, Verb(in_a),
                           b.name, Verb(in_b));
      }
      if (in_a.direction == Direction::kFromDevice) {
        warnings.push_back(fmt::format(
            "CAN id {:#05x}: both '{}' and '{}' send {}; begun at the same instant they "
            "destroy each other: if the motors let you, give each an id of its own",
            in_a.id, a.name, b.name, in_a.layout.name));
      }
    }
  }
  return {};
}

// b's messages among the ids that are all a's.
std::optional<std::string> Within(const BusDevice& a, const BusDevice& b) {
  for (const IdRange& range : a.claims) {
    for (const BusMessage& message : b.messages) {
      if (!message.extended && message.id >= range.first && message.id <= range.last) {
        return fmt::format("CAN id {:#05x}: '{}' {}, but ids {:#05x} to {:#05x} are '{}'s",
                           message.id, b.name, Verb(message), range.first, range.last, a.name);
      }
    }
    for (const IdRange& other : b.claims) {
      const uint32_t first = std::max(range.first, other.first);
      if (first <= std::min(range.last, other.last)) {
        return fmt::format("CAN id {:#05x} is both '{}'s and '{}'s", first, a.name, b.name);
      }
    }
  }
  return {};
}

}  // namespace

void FindCollisions(const std::vector<BusDevice>& devices, std::vector<std::string>& errors,
                    std::vector<std::string>& warnings) {
  for (size_t i = 0; i < devices.size(); ++i) {
    for (size_t j = i + 1; j < devices.size(); ++j) {
      auto collision = SameId(devices[i], devices[j], warnings);
      if (!collision) collision = Within(devices[i], devices[j]);
      if (!collision) collision = Within(devices[j], devices[i]);
      if (collision) errors.push_back(*collision);
    }
  }
}

}  // namespace plumb
