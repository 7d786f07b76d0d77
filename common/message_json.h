#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "common/message_type.h"

namespace plumb {

// Messages as JSON (RFC 8259), any type: fields by their own names, structs as objects, arrays as
// arrays, matrices flattened row by row, NaN and infinities as null. Numbers are the shortest that
// read back as they were; integers beyond 2^53 are exact here, but not in JavaScript. Texts are as
// Printable has them, of many lines. Thread-safe.

/// Appends a message as it came from LCM, with or without a seal behind it.
/// @return whether it decodes as that type; if not, `json` is as it was.
bool AppendJson(const MessageType& type, std::span<const uint8_t> message, std::string& json);

/// Appends a text from outside as a JSON string, with its quotation marks.
void AppendJsonText(std::string_view text, std::string& json);

/// Appends a number, or null if it is not finite.
void AppendJsonNumber(double number, std::string& json);

}  // namespace plumb
