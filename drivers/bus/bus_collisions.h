#pragma once

#include <string>
#include <vector>

#include "drivers/protocols/bus_device.h"

namespace plumb {

/// Finds ids that two devices send, or one sends and the other obeys, and devices within each
/// other's ranges. Each such pair gives one sentence with both names and the id.
/// @param errors, warnings are appended to. Thread-safe.
void FindCollisions(const std::vector<BusDevice>& devices, std::vector<std::string>& errors,
                    std::vector<std::string>& warnings);

}  // namespace plumb
