#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "common/seal.h"
#include "plumb/lockstep_post_t.hpp"

namespace plumb {

/// A message that was said in a run, without its seal; nothing if it is none of this type.
/// Thread-safe.
template <class Message>
std::optional<Message> Decoded(const lockstep_post_t& post) {
  Message message;
  const std::span<const uint8_t> bytes = Unsealed(post.data);
  const int size = static_cast<int>(bytes.size());
  if (message.decode(bytes.data(), 0, size) != size) return std::nullopt;
  return message;
}

}  // namespace plumb
