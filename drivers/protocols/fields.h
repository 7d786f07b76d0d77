#pragma once

#include <algorithm>
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

/// A number in a CAN payload: value = raw * scale + offset. Constant, so thread-safe.
///
/// `bit` counts in the order in which the field's bytes follow each other:
///   kLittleEndian (Intel)     from bit 0 of byte 0, its least significant; the field's least
///                             significant bit
///   kBigEndian    (Motorola)  from bit 7 of byte 0, its most significant; the field's most
///                             significant bit
/// so that in either order a field covers the bits [bit, bit + bits) of byte bit / 8 and those that
/// follow.
struct Field {
  enum class Kind : uint8_t { kUnsigned, kSigned, kFloat };
  enum class Order : uint8_t { kLittleEndian, kBigEndian };

  std::string_view name;
  uint16_t bit = 0;
  /// width; 32 for kFloat (IEEE 754 binary32); at most 48, so that a double holds it exactly
  uint8_t bits = 0;
  Kind kind = Kind::kUnsigned;
  double scale = 1;
  std::string_view unit = "";
  Order order = Order::kLittleEndian;
  double offset = 0;

  constexpr uint64_t mask() const { return (uint64_t{1} << bits) - 1; }

  /// The ends of what an integer field can say; of a float, the largest finite numbers.
  constexpr double lowest() const {
    if (kind == Kind::kFloat) return -std::numeric_limits<float>::max() * scale + offset;
    return kind == Kind::kSigned ? -(static_cast<double>(mask() >> 1) + 1) * scale + offset
                                 : offset;
  }
  constexpr double highest() const {
    if (kind == Kind::kFloat) return std::numeric_limits<float>::max() * scale + offset;
    return static_cast<double>(kind == Kind::kSigned ? mask() >> 1 : mask()) * scale + offset;
  }
  /// Whether Encode keeps the value, but for rounding. False for not-a-number.
  constexpr bool Holds(double value) const { return value >= lowest() && value <= highest(); }

  /// @param payload eight bytes as a little-endian number, which the field lies in.
  constexpr double Decode(uint64_t payload) const {
    const uint64_t raw =
        (order == Order::kBigEndian ? SwapBytes(payload) : payload) >> shift() & mask();
    if (kind == Kind::kFloat)
      return static_cast<double>(std::bit_cast<float>(static_cast<uint32_t>(raw))) * scale + offset;
    if (kind == Kind::kSigned && (raw >> (bits - 1) & 1) != 0) {
      return (static_cast<double>(raw) - static_cast<double>(mask()) - 1) * scale + offset;
    }
    return static_cast<double>(raw) * scale + offset;
  }

  /// Rounds to the nearest representable value (an unsigned field half-way between two: to the
  /// lower one); saturates integers at the ends of their range. Not-a-number becomes, in an
  /// integer, what is nearest to 0.
  /// @return the field's bits in place, in a payload as Decode takes it.
  constexpr uint64_t Encode(double value) const {
    const uint64_t raw = Raw(value) << shift();
    return order == Order::kBigEndian ? SwapBytes(raw) : raw;
  }

  /// The same field, in the bytes from its own first one on.
  constexpr Field InOwnBytes() const {
    Field field = *this;
    field.bit = bit % 8;
    return field;
  }

 private:
  static constexpr uint64_t SwapBytes(uint64_t x) {
    uint64_t swapped = 0;
    for (int byte = 0; byte < 8; ++byte) swapped |= (x >> (8 * byte) & 0xFF) << (56 - 8 * byte);
    return swapped;
  }
  /// Of the least significant bit, in the payload as a number of the field's byte order.
  constexpr int shift() const { return order == Order::kBigEndian ? 64 - bit - bits : bit; }

  constexpr uint64_t Raw(double value) const {
    if (kind == Kind::kFloat) {
      return std::bit_cast<uint32_t>(static_cast<float>((value - offset) / scale));
    }
    double raw = ((value == value ? value : 0) - offset) / scale;
    const double top = static_cast<double>(kind == Kind::kSigned ? mask() >> 1 : mask());
    const double bottom = kind == Kind::kSigned ? -top - 1 : 0;
    if (raw < bottom) raw = bottom;
    if (raw > top) raw = top;
    // A range without a code for 0 has it half-way between two, but for the last bits of this
    // division.
    const double half = kind == Kind::kSigned ? 0.5 : 0.5 - 1e-6;
    return static_cast<uint64_t>(static_cast<int64_t>(raw < 0 ? raw - half : raw + half)) & mask();
  }
};

/// An unsigned field whose codes divide [min, max] evenly, both ends included, as the MIT protocol
/// has them: value = raw * (max - min) / (2^bits - 1) + min.
constexpr Field RangeField(std::string_view name, int bit, int bits, double min, double max,
                           std::string_view unit = "",
                           Field::Order order = Field::Order::kBigEndian) {
  Field field{
      name, static_cast<uint16_t>(bit), static_cast<uint8_t>(bits), Field::Kind::kUnsigned, 1, unit,
      order};
  field.scale = (max - min) / static_cast<double>(field.mask());
  field.offset = min;
  return field;
}

/// A message's layout.
struct Layout {
  static constexpr size_t kMaxFields = 12;

  uint16_t command = 0;  ///< the protocol's number of it, which the id is made of
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

/// Writes values into a frame's payload, where their fields' bits are 0; leaves all else. Missing
/// values are 0.
constexpr void EncodeFields(const Layout& layout, std::initializer_list<double> values,
                            Frame& frame) {
  size_t i = 0;
  for (const double value : values) {
    const Field& field = layout.fields[i++];
    const uint64_t bytes = field.InOwnBytes().Encode(value);
    const size_t first = field.bit / 8u, last = std::min(first + 8, frame.data.size());
    for (size_t byte = first; byte < last; ++byte)
      frame.data[byte] |= static_cast<uint8_t>(bytes >> (8 * (byte - first)));
  }
}

/// Fills a frame's payload. Missing values are 0.
constexpr void EncodePayload(const Layout& layout, std::initializer_list<double> values,
                             Frame& frame) {
  frame.length = layout.length;
  for (size_t byte = 0; byte < layout.length; ++byte) frame.data[byte] = 0;
  EncodeFields(layout, values, frame);
}

/// Reads a frame's payload. @return nothing if it is too short, or longer than a classic frame
/// and the layout's own. The values may not be finite.
constexpr std::optional<FieldValues> DecodePayload(const Layout& layout, const Frame& frame) {
  if (frame.remote || frame.length < layout.needed() ||
      frame.length > std::max<size_t>(8, layout.length))
    return {};
  FieldValues values{};
  for (size_t i = 0; i < layout.count(); ++i) {
    const Field& field = layout.fields[i];
    const size_t first = field.bit / 8u, last = std::min<size_t>(first + 8, frame.length);
    uint64_t bytes = 0;
    for (size_t byte = first; byte < last; ++byte)
      bytes |= uint64_t{frame.data[byte]} << (8 * (byte - first));
    values[i] = field.InOwnBytes().Decode(bytes);
  }
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
