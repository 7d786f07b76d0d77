#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <optional>
#include <span>
#include <string_view>

#include "drivers/can/frame.h"

namespace plumb {

/// Where a number lies in a classic CAN payload, little-endian (Intel order), and what it means.
struct Field {
  enum class Kind : uint8_t { kUnsigned, kSigned, kFloat };

  std::string_view name;
  uint8_t bit = 0;  ///< of the least significant bit, counted from bit 0 of byte 0
  uint8_t bits =
      0;  ///< width; 32 for kFloat (IEEE 754 binary32); at most 48, so that a double holds it exactly
  Kind kind = Kind::kUnsigned;
  double scale = 1;  ///< value = raw * scale
  std::string_view unit = "";

  constexpr uint64_t mask() const { return (uint64_t{1} << bits) - 1; }

  /// @param payload the payload's bytes as a little-endian number.
  constexpr double Decode(uint64_t payload) const {
    const uint64_t raw = payload >> bit & mask();
    if (kind == Kind::kFloat)
      return static_cast<double>(std::bit_cast<float>(static_cast<uint32_t>(raw))) * scale;
    if (kind == Kind::kSigned && (raw >> (bits - 1) & 1) != 0) {
      return (static_cast<double>(raw) - static_cast<double>(mask()) - 1) * scale;
    }
    return static_cast<double>(raw) * scale;
  }

  /// Rounds to the nearest representable value; saturates integers at the ends of their range. Not-a-number
  /// becomes 0 in an integer. @return the field's bits in place.
  constexpr uint64_t Encode(double value) const {
    if (kind == Kind::kFloat) {
      return uint64_t{std::bit_cast<uint32_t>(static_cast<float>(value / scale))} << bit;
    }
    const double top = static_cast<double>(kind == Kind::kSigned ? mask() >> 1 : mask());
    const double bottom = kind == Kind::kSigned ? -top - 1 : 0;
    double raw = value / scale;
    if (!(raw >= bottom)) raw = raw < bottom ? bottom : 0;  // the second case is not-a-number
    if (raw > top) raw = top;
    const auto rounded = static_cast<int64_t>(raw < 0 ? raw - 0.5 : raw + 0.5);
    return (static_cast<uint64_t>(rounded) & mask()) << bit;
  }
};

/// A message's layout.
struct Layout {
  static constexpr size_t kMaxFields = 8;

  uint8_t command = 0;
  std::string_view name;
  uint8_t length = 0;  ///< bytes when we send it
  std::array<Field, kMaxFields> fields{};

  constexpr size_t count() const {
    size_t count = 0;
    while (count < kMaxFields && fields[count].bits != 0) ++count;
    return count;
  }
  /// Bytes a received message must at least have.
  constexpr size_t needed() const {
    size_t needed = 0;
    for (size_t i = 0; i < count(); ++i) {
      const size_t end = (fields[i].bit + fields[i].bits + 7u) / 8u;
      if (end > needed) needed = end;
    }
    return needed;
  }
};

/// Values of a message in the order of its fields.
using FieldValues = std::array<double, Layout::kMaxFields>;

/// Fills a frame's payload. Missing values are 0.
constexpr void EncodePayload(const Layout& layout, std::initializer_list<double> values, Frame& frame) {
  uint64_t payload = 0;
  size_t i = 0;
  for (const double value : values) payload |= layout.fields[i++].Encode(value);
  frame.length = layout.length;
  for (size_t byte = 0; byte < layout.length; ++byte)
    frame.data[byte] = static_cast<uint8_t>(payload >> (8 * byte));
}

/// Reads a frame's payload. @return nothing if it is too short or too long for a classic frame. The values
/// may not be finite.
constexpr std::optional<FieldValues> DecodePayload(const Layout& layout, const Frame& frame) {
  if (frame.remote || frame.length < layout.needed() || frame.length > 8) return {};
  uint64_t payload = 0;
  for (size_t byte = 0; byte < frame.length; ++byte) payload |= uint64_t{frame.data[byte]} << (8 * byte);
  FieldValues values{};
  for (size_t i = 0; i < layout.count(); ++i) values[i] = layout.fields[i].Decode(payload);
  return values;
}

/// True if the layout's values are all finite.
inline bool AllFinite(const Layout& layout, const FieldValues& values) {
  for (size_t i = 0; i < layout.count(); ++i) {
    if (!std::isfinite(values[i])) return false;
  }
  return true;
}

}  // namespace plumb
