#pragma once

#include <string>

#include "common/message_type.h"

namespace plumb {

/// JSON Schema (2020-12) of what AppendJson makes of a type, as Foxglove and MCAP want it
/// ("jsonschema"). Numbers may be null, too, which it does not say: Foxglove and Lichtblick know no
/// field of two types. Thread-safe.
std::string JsonSchema(const MessageType& type);

}  // namespace plumb
