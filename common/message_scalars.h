#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <variant>

#include "common/message_type.h"

namespace plumb {

/// A value that has no parts. A text is as it came, any bytes, and valid during the call.
using Scalar = std::variant<int64_t, float, double, bool, std::string_view>;

/// A message's values one by one, for tables: "utime", "q[0]", "residual[2].mean[0]". Matrices are
/// flattened, row by row.
/// @param use may have been told the beginning of a message that does not decode.
/// @return whether it decodes as that type. Thread-safe.
bool ForEachScalar(const MessageType& type, std::span<const uint8_t> message,
                   const std::function<void(const std::string& path, const Scalar&)>& use);

}  // namespace plumb
