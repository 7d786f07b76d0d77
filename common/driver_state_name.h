#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "plumb/driver_status_t.hpp"

namespace plumb {

/// "ARMED" and so on of a driver_status_t's state; "?" if it has none of its values. Thread-safe.
constexpr std::string_view DriverStateName(int8_t state) {
  constexpr std::array<std::string_view, 5> kNames{"ABSENT", "IDLE", "ARMING", "ARMED", "FAULT"};
  static_assert(driver_status_t::ABSENT == 0 && driver_status_t::FAULT == kNames.size() - 1);
  return state >= 0 && static_cast<size_t>(state) < kNames.size()
             ? kNames[static_cast<size_t>(state)]
             : "?";
}

}  // namespace plumb
