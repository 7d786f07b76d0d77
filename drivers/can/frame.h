#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

namespace plumb {

/// One CAN frame, classic or FD, independent of the transport. Trivially copyable.
struct Frame {
  uint32_t id = 0;        ///< 11 or 29 bits; the error class if `error`
  bool extended = false;  ///< 29-bit id
  bool remote = false;    ///< request (RTR); carries a length but no data
  /// made by the controller, see error_frame.h; was never on the bus
  bool error = false;
  bool fd = false;                     ///< CAN FD
  bool bit_rate_switch = false;        ///< FD only
  bool error_state_indicator = false;  ///< FD only
  bool foreign = false;                ///< received, though only we may send it (Filter::own)
  uint8_t length = 0;                  ///< bytes, 0..8, FD 0..64
  std::array<uint8_t, 64> data{};
  /// CLOCK_REALTIME [ns] of reception as the kernel stamped it; 0 = not received
  int64_t receive_ns = 0;

  std::span<const uint8_t> payload() const { return {data.data(), remote ? size_t{0} : length}; }
};
static_assert(std::is_trivially_copyable_v<Frame>);

/// Equal on the wire: everything but the time of reception. Functions here are thread-safe.
bool SameOnWire(const Frame& a, const Frame& b);

/// True if id and length are possible for the frame's kind (11/29 bits; 8 bytes, or an FD length)
/// and the flags do not contradict each other.
bool IsWellFormed(const Frame& frame);

/// candump's form: `02E#0000C03F00000000`, remote `029#R` or `029#R8`, extended ids in 8 digits, FD
/// `124##1112233` (flags nibble: 1 = bit rate switch, 2 = error state indicator; 4 = FD, read but
/// not written), error frames with bit 29 set in 8 digits (`20000040#0000000000000000`).
std::string ToText(const Frame& frame);
/// Reads that form. @return nothing if the text is not exactly one well-formed frame.
std::optional<Frame> FrameFromText(std::string_view text);

/// Frames to be sent in one go: a fixed capacity, so that the driver's cycle does not allocate.
class FrameBatch {
 public:
  static constexpr size_t kCapacity = 64;

  /// @return false, and drops the frame, if the batch is full.
  bool Push(const Frame& frame) noexcept {
    if (count_ == kCapacity) return false;
    frames_[count_++] = frame;
    return true;
  }
  void Clear() noexcept { count_ = 0; }
  size_t size() const noexcept { return count_; }
  size_t room() const noexcept { return kCapacity - count_; }
  std::span<const Frame> frames() const noexcept { return {frames_.data(), count_}; }

 private:
  std::array<Frame, kCapacity> frames_;
  size_t count_ = 0;
};

}  // namespace plumb
