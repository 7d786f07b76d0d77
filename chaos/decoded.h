#pragma once

#include <optional>

#include "common/message_bytes.h"
#include "common/seal.h"
#include "plumb/lockstep_post_t.hpp"

namespace plumb {

/// A message that was said in a run, without its seal; nothing if it is none of this type.
/// Thread-safe.
template <class Message>
std::optional<Message> Decoded(const lockstep_post_t& post) {
  Message message;
  if (!Decode(Unsealed(post.data), message)) return std::nullopt;
  return message;
}

}  // namespace plumb
