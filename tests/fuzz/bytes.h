#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <span>

#include "drivers/can/frame.h"

namespace plumb {

/// Says where, and ends the program, which is how libFuzzer learns of a mistake.
inline void Require(bool right, const char* file = __builtin_FILE(), int line = __builtin_LINE()) {
  if (right) return;
  std::fprintf(stderr, "%s:%d: what must hold does not\n", file, line);
  std::abort();
}

/// A fuzzer's input, read from front to back; zeros when it has ended.
class Bytes {
 public:
  explicit Bytes(std::span<const uint8_t> bytes) : bytes_(bytes) {}

  bool empty() const { return bytes_.empty(); }

  template <class T>
  T Value() {
    std::array<uint8_t, sizeof(T)> raw{};
    const size_t size = std::min(raw.size(), bytes_.size());
    if (size > 0) std::memcpy(raw.data(), bytes_.data(), size);
    bytes_ = bytes_.subspan(size);
    T value;
    std::memcpy(&value, raw.data(), sizeof(T));
    return value;
  }
  uint8_t Byte() { return Value<uint8_t>(); }

  template <class List>
  auto Pick(const List& list) {
    return list[Byte() % std::size(list)];
  }

  /// Any double: often a modest one, sometimes the worst there are.
  double Number() {
    using Limits = std::numeric_limits<double>;
    static constexpr double kWorst[] = {Limits::quiet_NaN(),
                                        Limits::infinity(),
                                        -Limits::infinity(),
                                        Limits::max(),
                                        Limits::lowest(),
                                        Limits::denorm_min(),
                                        -0.,
                                        3.5e38,
                                        -1e10};
    const uint8_t kind = Byte();
    if (kind < 64) return kWorst[kind % std::size(kWorst)];
    if (kind < 96) return Value<double>();
    return Modest(100);
  }
  /// In [-most, most].
  double Modest(double most) { return most * Value<int16_t>() / 32768.; }

  /// A well-formed frame, as transports hand them out, with one of the ids or one near it.
  /// @param fd whether most shall be of CAN FD, with ids of 29 bits where 11 do not do.
  Frame AnyFrame(std::span<const uint32_t> ids, bool fd = false) {
    Frame frame;
    const uint8_t kind = Byte();
    frame.id = Pick(ids);
    if ((kind & 0x07) == 7) frame.id ^= Value<uint16_t>() & 0x7FF;
    frame.extended = (kind & 0x18) == 0x18;
    frame.remote = (kind & 0x28) == 0x28;
    frame.error = (kind & 0x48) == 0x48;
    frame.fd = ((kind & 0x88) == 0x88) != fd;
    frame.extended = frame.extended != (fd && frame.id > 0x7FF);
    frame.bit_rate_switch = frame.fd && (kind & 1) != 0;
    static constexpr uint8_t kLengths[] = {8, 8, 8, 0, 1, 2, 3, 4, 5, 6, 7, 12, 64},
                             kFdLengths[] = {32, 48, 12, 6, 16, 3, 0, 64};
    frame.length = fd ? Pick(kFdLengths) : Pick(kLengths);
    if (!frame.fd) frame.length = std::min<uint8_t>(frame.length, 8);
    for (size_t i = 0; i < frame.length; ++i) frame.data[i] = Byte();
    if (!IsWellFormed(frame)) frame.extended = frame.remote = frame.error = false;
    return frame;
  }

 private:
  std::span<const uint8_t> bytes_;
};

/// A bus that harms frames on their way: some are lost, come twice, are cut or have bits flipped.
class BadWire {
 public:
  /// The next frames, up to 255, are treated as the input says.
  void Spoil(Bytes& bytes) {
    frames_ = bytes.Byte();
    how_ = bytes.Byte();
    where_ = bytes.Byte();
    flip_ = bytes.Byte();
  }
  void Mend() { frames_ = 0; }

  /// Gives what arrives of the frame to `deliver`.
  template <class Deliver>
  void Carry(Frame frame, Deliver deliver) {
    if (frames_ == 0) return deliver(frame);
    --frames_;
    if ((how_ & 1) != 0 && frames_ % 2 == 0) return;
    if ((how_ & 2) != 0) frame.length = std::min<uint8_t>(frame.length, where_ >> 4 & 7);
    frame.data[where_ & (frame.fd ? 31 : 7)] ^= flip_;
    if ((how_ & 4) != 0) frame.id ^= 1u << (where_ >> 4) % 11;
    deliver(frame);
    if ((how_ & 8) != 0) deliver(frame);
  }

 private:
  uint8_t frames_ = 0, how_ = 0, where_ = 0, flip_ = 0;
};

/// [us] between two operations.
inline constexpr int64_t kSteps[] = {1000,    0,       1,         200,          2000,    5000,
                                     20'000,  50'000,  100'000,   190'000,      250'000, 1'000'000,
                                     999'999, 500'000, 4'000'000, 3'600'000'000};

}  // namespace plumb
