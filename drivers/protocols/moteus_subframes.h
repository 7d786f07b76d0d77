#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "drivers/protocols/moteus.h"

/// The subframes of moteus' frames, whatever they are: read and written byte by byte, as a motor
/// does. The driver sends and expects frames of few shapes, which moteus.h has. Not thread-safe.
namespace plumb::moteus {

/// Numbers from a frame, as long as there are any.
class SubframeReader {
 public:
  /// @param frame outlives the reader.
  explicit SubframeReader(const Frame& frame) : bytes_(frame.payload()) {}

  bool empty() const { return at_ == bytes_.size(); }
  std::optional<uint32_t> Byte();
  /// Seven bits a byte, the least first; the highest bit says that there are more.
  std::optional<uint32_t> Number();

  /// Which registers a kWrite or kRead is of.
  struct Registers {
    uint32_t count, first;
    int format;
  };
  std::optional<Registers> RegistersOf(uint32_t subframe);
  /// A register's value in its unit; not-a-number for the most negative integer.
  std::optional<double> Value(uint32_t number, int format);

  /// Of kToMotor and kAskText, for the one channel that there is: how many characters.
  std::optional<uint32_t> TextSize();
  std::optional<std::string_view> Text(size_t size);

 private:
  std::span<const uint8_t> bytes_;
  size_t at_ = 0;
};

/// Bytes of an answer, up to a frame's.
class SubframeWriter {
 public:
  void Byte(uint32_t byte);
  void Number(uint32_t number);
  void Refuse(Subframe error, uint32_t number);
  void Value(uint32_t number, int format, double value);
  std::span<const uint8_t> bytes() const { return std::span(bytes_).first(size_); }

 private:
  std::array<uint8_t, 64> bytes_{};
  size_t size_ = 0;
};

}  // namespace plumb::moteus
