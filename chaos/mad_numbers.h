#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/random.h"

namespace plumb {

/// The message with some of its numbers replaced by mad ones: not finite, huge, negative, slightly
/// wrong. @param message without a seal. @return nothing if no message of that channel can be mad,
/// or it does not decode. Thread-safe.
std::optional<std::vector<uint8_t>> WithMadNumbers(const std::string& channel,
                                                   std::span<const uint8_t> message,
                                                   Random& random);

}  // namespace plumb
