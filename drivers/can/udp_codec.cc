#include "drivers/can/udp_codec.h"

#include <array>
#include <bit>
#include <cstring>
#include <string_view>

namespace plumb {
namespace {

// In the order in which python-can writes them.
enum Key {
  kTimestamp,
  kId,
  kExtended,
  kRemote,
  kError,
  kChannel,
  kDlc,
  kData,
  kFd,
  kBitRateSwitch,
  kEsi,
  kKeys
};
constexpr std::array<std::string_view, kKeys> kNames = {"timestamp",
                                                        "arbitration_id",
                                                        "is_extended_id",
                                                        "is_remote_frame",
                                                        "is_error_frame",
                                                        "channel",
                                                        "dlc",
                                                        "data",
                                                        "is_fd",
                                                        "bitrate_switch",
                                                        "error_state_indicator"};

/// The few msgpack forms that the format needs (github.com/msgpack/msgpack/blob/master/spec.md).
class Writer {
 public:
  explicit Writer(uint8_t* out) : begin_(out), out_(out) {}

  size_t size() const { return static_cast<size_t>(out_ - begin_); }
  void Byte(uint8_t byte) { *out_++ = byte; }
  void Map(size_t pairs) { Byte(static_cast<uint8_t>(0x80 | pairs)); }
  void Name(Key key) {
    const std::string_view name = kNames[key];
    Byte(static_cast<uint8_t>(0xA0 | name.size()));
    Bytes(name.data(), name.size());
  }
  void Bool(Key key, bool value) { Name(key), Byte(value ? 0xC3 : 0xC2); }
  void Unsigned(Key key, uint32_t value) {
    Name(key);
    if (value < 0x80) return Byte(static_cast<uint8_t>(value));
    const int bytes = value < 0x100 ? 1 : value < 0x10000 ? 2 : 4;
    Byte(bytes == 1 ? 0xCC : bytes == 2 ? 0xCD : 0xCE);
    BigEndian(value, bytes);
  }
  void Float(Key key, double value) {
    Name(key), Byte(0xCB), BigEndian(std::bit_cast<uint64_t>(value), 8);
  }
  void Nil(Key key) { Name(key), Byte(0xC0); }
  void Binary(Key key, std::span<const uint8_t> bytes) {
    Name(key), Byte(0xC4), Byte(static_cast<uint8_t>(bytes.size())),
        Bytes(bytes.data(), bytes.size());
  }

 private:
  void Bytes(const void* from, size_t count) {
    std::memcpy(out_, from, count);
    out_ += count;
  }
  void BigEndian(uint64_t value, int bytes) {
    for (int shift = 8 * (bytes - 1); shift >= 0; shift -= 8)
      Byte(static_cast<uint8_t>(value >> shift));
  }

  uint8_t* begin_;
  uint8_t* out_;
};

/// Reads the same forms. Every method returns false at the end of the input or at another form.
class Reader {
 public:
  explicit Reader(std::span<const uint8_t> in) : in_(in) {}

  bool AtEnd() const { return in_.empty(); }
  bool Map(size_t& pairs) {
    uint8_t tag;
    uint64_t count;
    if (!Byte(tag)) return false;
    if ((tag & 0xF0) == 0x80) return pairs = tag & 0xFu, true;
    if (tag != 0xDE || !BigEndian(2, count)) return false;
    return pairs = count, true;
  }
  bool String(std::string_view& text) {
    uint8_t tag;
    uint64_t size;
    if (!Byte(tag)) return false;
    if ((tag & 0xE0) == 0xA0) {
      size = tag & 0x1Fu;
    } else if (tag != 0xD9 || !BigEndian(1, size)) {
      return false;
    }
    std::span<const uint8_t> bytes;
    if (!Take(size, bytes)) return false;
    text = {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
    return true;
  }
  bool Bool(bool& value) {
    uint8_t tag;
    if (!Byte(tag) || (tag != 0xC2 && tag != 0xC3)) return false;
    return value = tag == 0xC3, true;
  }
  bool Unsigned(uint64_t& value) {
    uint8_t tag;
    if (!Byte(tag)) return false;
    if (tag < 0x80) return value = tag, true;
    if (tag < 0xCC || tag > 0xCF) return false;
    return BigEndian(1 << (tag - 0xCC), value);
  }
  /// A float64; python writes an integer when it was given one.
  bool Number() {
    if (in_.empty()) return false;
    uint64_t value;
    if (in_[0] != 0xCB) return Unsigned(value);
    in_ = in_.subspan(1);
    return BigEndian(8, value);
  }
  /// Nil, or the name or number that a bus had where the frame was recorded.
  bool Channel() {
    if (in_.empty()) return false;
    if (in_[0] == 0xC0) return in_ = in_.subspan(1), true;
    std::string_view text;
    uint64_t number;
    return (in_[0] & 0xE0) == 0xA0 || in_[0] == 0xD9 ? String(text) : Unsigned(number);
  }
  bool Binary(std::span<const uint8_t>& bytes) {
    uint8_t tag;
    uint64_t size;
    return Byte(tag) && tag == 0xC4 && BigEndian(1, size) && Take(size, bytes);
  }

 private:
  bool Byte(uint8_t& byte) {
    if (in_.empty()) return false;
    byte = in_[0];
    in_ = in_.subspan(1);
    return true;
  }
  bool Take(uint64_t count, std::span<const uint8_t>& bytes) {
    if (count > in_.size()) return false;
    bytes = in_.first(count);
    in_ = in_.subspan(count);
    return true;
  }
  bool BigEndian(size_t count, uint64_t& value) {
    std::span<const uint8_t> bytes;
    if (!Take(count, bytes)) return false;
    value = 0;
    for (const uint8_t byte : bytes) value = value << 8 | byte;
    return true;
  }

  std::span<const uint8_t> in_;
};

/// @param expected the key that comes next if the sender keeps python-can's order: saves ten
/// comparisons.
Key FindKey(std::string_view name, size_t expected) {
  if (name == kNames[expected]) return static_cast<Key>(expected);
  for (size_t i = 0; i < kKeys; ++i) {
    if (name == kNames[i]) return static_cast<Key>(i);
  }
  return kKeys;
}

}  // namespace

size_t EncodeUdp(const Frame& frame, double timestamp, std::span<uint8_t> datagram) noexcept {
  Writer writer(datagram.data());
  writer.Map(kKeys);
  writer.Float(kTimestamp, timestamp);
  writer.Unsigned(kId, frame.id);
  writer.Bool(kExtended, frame.extended);
  writer.Bool(kRemote, frame.remote);
  writer.Bool(kError, frame.error);
  writer.Nil(kChannel);
  writer.Unsigned(kDlc, frame.length);
  writer.Binary(kData, frame.payload());
  writer.Bool(kFd, frame.fd);
  writer.Bool(kBitRateSwitch, frame.bit_rate_switch);
  writer.Bool(kEsi, frame.error_state_indicator);
  return writer.size();
}

bool DecodeUdp(std::span<const uint8_t> datagram, Frame& frame) noexcept {
  Reader reader(datagram);
  size_t pairs;
  if (!reader.Map(pairs) || pairs != kKeys) return false;
  unsigned seen = 0;
  uint64_t id = 0, length = 0;
  std::span<const uint8_t> data;
  frame = Frame{};
  for (size_t i = 0; i < kKeys; ++i) {
    std::string_view name;
    if (!reader.String(name)) return false;
    const Key key = FindKey(name, i);
    if (key == kKeys || (seen & 1u << key) != 0) return false;
    seen |= 1u << key;
    bool read = false;
    switch (key) {
      case kTimestamp:
        read = reader.Number();
        break;
      case kId:
        read = reader.Unsigned(id);
        break;
      case kExtended:
        read = reader.Bool(frame.extended);
        break;
      case kRemote:
        read = reader.Bool(frame.remote);
        break;
      case kError:
        read = reader.Bool(frame.error);
        break;
      case kChannel:
        read = reader.Channel();
        break;
      case kDlc:
        read = reader.Unsigned(length);
        break;
      case kData:
        read = reader.Binary(data);
        break;
      case kFd:
        read = reader.Bool(frame.fd);
        break;
      case kBitRateSwitch:
        read = reader.Bool(frame.bit_rate_switch);
        break;
      case kEsi:
        read = reader.Bool(frame.error_state_indicator);
        break;
      case kKeys:
        break;
    }
    if (!read) return false;
  }
  if (!reader.AtEnd() || id > 0x1FFFFFFF || length > 64) return false;
  frame.id = static_cast<uint32_t>(id);
  frame.length = static_cast<uint8_t>(length);
  if (!IsWellFormed(frame) || data.size() != (frame.remote ? 0 : length)) return false;
  if (!data.empty()) std::memcpy(frame.data.data(), data.data(), data.size());
  return true;
}

}  // namespace plumb
