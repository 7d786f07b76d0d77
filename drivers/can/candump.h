#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "drivers/can/frame.h"

namespace plumb {

/// A line of a log.
struct LoggedFrame {
  int64_t time_ns = 0;         ///< [ns] as logged, usually CLOCK_REALTIME
  std::string_view interface;  ///< into the line
  Frame frame;                 ///< receive_ns = time_ns
};

/// Reads a line as candump -l and python-can's loggers write it,
///
///   (1700000000.263847) can0 02E#0000C03F00000000
///
/// with frames of every kind (see FrameFromText), up to nine decimals, and a direction "R" or "T"
/// behind.
/// @return nothing if the line is not exactly that. Thread-safe.
std::optional<LoggedFrame> ParseCandump(std::string_view line) noexcept;

}  // namespace plumb
