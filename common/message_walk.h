#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "common/message_type.h"

namespace plumb {

/// Is told what a message has in it, in order.
class MessageVisitor {
 public:
  virtual ~MessageVisitor() = default;
  /// What comes next is this field of the struct that is under way.
  virtual void Field(std::string_view name) = 0;
  virtual void BeginStruct() = 0;
  virtual void EndStruct() = 0;
  /// Matrices are flattened, row by row.
  virtual void BeginArray(size_t elements) = 0;
  virtual void EndArray() = 0;
  virtual void Integer(int64_t value) = 0;
  virtual void Float(float value) = 0;
  virtual void Double(double value) = 0;
  virtual void Boolean(bool value) = 0;
  /// As it came: any bytes. Valid during the call.
  virtual void Text(std::string_view value) = 0;
};

/// Reads a message as it came from LCM, with or without a seal behind it, straight from its bytes:
/// nothing is allocated by a length that it names, and every length is held against the bytes that
/// are left. The visitor may have been told the beginning of a message that does not decode.
/// @return whether the bytes are a message of that type, all of them. Thread-safe.
bool WalkMessage(const MessageType& type, std::span<const uint8_t> message,
                 MessageVisitor& visitor);

/// Whether the bytes are a message of that type.
bool Decodes(const MessageType& type, std::span<const uint8_t> message);

}  // namespace plumb
