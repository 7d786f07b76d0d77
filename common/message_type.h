#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace plumb {

/// A type of lcmtypes/, as lcm-gen describes it: what is needed to read any message without code of
/// its own for each type (message_walk.h). Thread-safe (immutable), as all functions here.
struct MessageType {
  enum class Kind {
    kInt8,
    kInt16,
    kInt32,
    kInt64,
    kByte,
    kFloat,
    kDouble,
    kString,
    kBoolean,
    kStruct
  };
  /// Of an array, whose elements are as many as an earlier field of the same struct says, or always
  /// the same number.
  struct Dimension {
    int counted_by = -1;  ///< that field's index; -1: `size` elements
    int64_t size = 0;
  };
  struct Field {
    std::string name;
    Kind kind;
    const MessageType* type = nullptr;    ///< of a struct
    std::vector<Dimension> dimensions{};  ///< none: a scalar; row by row
  };

  std::string name;     ///< "robot_state_t"
  int64_t fingerprint;  ///< that an encoded message begins with
  std::vector<Field> fields;
  size_t least_size = 0;  ///< [bytes] of the shortest there is, without the fingerprint; > 0
};

/// "plumb.robot_state_t", as other tools call it.
std::string QualifiedName(const MessageType& type);

/// All there are, in order of their names; those that are parts of others, too.
std::span<const MessageType> MessageTypes();
/// @param name "robot_state_t". @return null if there is none.
const MessageType* FindMessageType(std::string_view name);
/// By the fingerprint. @return null if no type of ours has it.
const MessageType* TypeOf(std::span<const uint8_t> message);

/// [bytes] of the shortest element there is.
size_t LeastSize(const MessageType::Field& field);

}  // namespace plumb
