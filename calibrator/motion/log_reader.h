#pragma once

#include <cstdint>
#include <exception>
#include <functional>
#include <string>

#include "common/message_bytes.h"

namespace plumb {

// The functions here share nothing: thread-safe if the given function is, which the caller's thread
// calls.

/// How far a log was read.
struct LogEnd {
  int64_t events = 0;    ///< whole ones
  bool cut_off = false;  ///< in the middle of an event, where a logger was killed: it ends there
};

/// Reads an LCM log event by event, in the file's order.
/// @param on_event channel, data and size of the message without its seal, time of reception [us];
/// return false to stop.
/// @throws std::runtime_error naming the file if it is a folder, cannot be opened or is no LCM log,
/// or the byte at which it is damaged.
LogEnd ReadLog(const std::string& file,
               const std::function<bool(const std::string& channel, const void* data, int size,
                                        int64_t utime)>& on_event);

/// Whether it is a message of this type. A hostile one may ask for more memory than there is: then
/// it is none.
template <class Message>
bool Decodes(const void* data, int size, Message& message) noexcept {
  try {
    return Decode({static_cast<const uint8_t*>(data), static_cast<size_t>(size)}, message);
  } catch (const std::exception&) {
    return false;
  }
}

}  // namespace plumb
