#pragma once

#include <string>
#include <vector>

#include "drivers/protocols/bus_device.h"

namespace plumb {

/// A bus as a DBC file, the format of Vector's tools that most others read: every message of the
/// devices with its fields, from the very tables that driver and virtual devices use. Names are the
/// devices' and the fields', with an underscore for what is no letter or digit. Messages without
/// fields are left out; replies that several motors send with one id are multiplexed by their first
/// field. Requests (remote frames) have no place in a DBC. Thread-safe.
std::string ToDbc(const std::vector<BusDevice>& devices);

}  // namespace plumb
