#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "common/message_bytes.h"
#include "common/seal.h"

namespace plumb {

/// A message as it was said, with a seal or without; nothing if it is none of this type.
/// Thread-safe.
template <class Message>
std::optional<Message> Decoded(std::span<const uint8_t> bytes) {
  Message message;
  if (!Decode(Unsealed(bytes), message)) return std::nullopt;
  return message;
}

}  // namespace plumb
