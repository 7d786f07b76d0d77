#include "drivers/can/frame.h"

#include <algorithm>

namespace plumb {
namespace {

constexpr uint32_t kErrorBit = 0x20000000;
constexpr char kDigits[] = "0123456789ABCDEF";

bool IsFdLength(int length) {
  return length <= 8 || length == 12 || length == 16 || length == 20 || length == 24 ||
         length == 32 || length == 48 || length == 64;
}

int HexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  return -1;
}

/// The payload's hexadecimal digits. @return false for an odd number, a stranger, or too many.
bool ParseData(std::string_view digits, size_t capacity, Frame& frame) {
  if (digits.size() % 2 != 0 || digits.size() / 2 > capacity) return false;
  for (size_t i = 0; i < digits.size(); i += 2) {
    const int high = HexDigit(digits[i]), low = HexDigit(digits[i + 1]);
    if (high < 0 || low < 0) return false;
    frame.data[i / 2] = static_cast<uint8_t>(high << 4 | low);
  }
  frame.length = static_cast<uint8_t>(digits.size() / 2);
  return true;
}

}  // namespace

bool SameOnWire(const Frame& a, const Frame& b) {
  return a.id == b.id && a.extended == b.extended && a.remote == b.remote && a.error == b.error &&
         a.fd == b.fd && a.bit_rate_switch == b.bit_rate_switch &&
         a.error_state_indicator == b.error_state_indicator && a.length == b.length &&
         std::ranges::equal(a.payload(), b.payload());
}

bool IsWellFormed(const Frame& frame) {
  if (frame.id > (frame.extended || frame.error ? 0x1FFFFFFFu : 0x7FFu)) return false;
  if (frame.remote && (frame.error || frame.fd)) return false;
  if (frame.error && (frame.fd || frame.extended)) return false;
  if (!frame.fd && (frame.bit_rate_switch || frame.error_state_indicator)) return false;
  return frame.fd ? IsFdLength(frame.length) : frame.length <= 8;
}

std::string ToText(const Frame& frame) {
  std::string text;
  const uint32_t id = frame.error ? frame.id | kErrorBit : frame.id;
  for (int digit = frame.extended || frame.error ? 7 : 2; digit >= 0; --digit) {
    text += kDigits[id >> (4 * digit) & 0xF];
  }
  text += '#';
  if (frame.fd) {
    text += '#';
    text += kDigits[(frame.bit_rate_switch ? 1 : 0) | (frame.error_state_indicator ? 2 : 0)];
  }
  if (frame.remote) {
    text += 'R';
    if (frame.length > 0) text += kDigits[frame.length & 0xF];
    return text;
  }
  for (const uint8_t byte : frame.payload()) {
    text += kDigits[byte >> 4];
    text += kDigits[byte & 0xF];
  }
  return text;
}

std::optional<Frame> FrameFromText(std::string_view text) {
  const size_t hash = text.find('#');
  if (hash != 3 && hash != 8) return {};
  Frame frame;
  for (size_t i = 0; i < hash; ++i) {
    const int digit = HexDigit(text[i]);
    if (digit < 0) return {};
    frame.id = frame.id << 4 | static_cast<uint32_t>(digit);
  }
  if (hash == 8) {
    frame.error = (frame.id & kErrorBit) != 0;
    frame.extended = !frame.error;
    frame.id &= ~kErrorBit;
  }
  std::string_view rest = text.substr(hash + 1);
  if (rest.starts_with('#')) {
    const int flags = rest.size() > 1 ? HexDigit(rest[1]) : -1;
    if (flags < 0 || flags > 7) return {};  // bit 2 says FD once more
    frame.fd = true;
    frame.bit_rate_switch = (flags & 1) != 0;
    frame.error_state_indicator = (flags & 2) != 0;
    rest.remove_prefix(2);
  }
  if (rest.starts_with('R')) {
    frame.remote = true;
    if (rest.size() > 2) return {};
    const int length = rest.size() == 2 ? HexDigit(rest[1]) : 0;
    if (length < 0) return {};
    frame.length = static_cast<uint8_t>(length);
  } else if (!ParseData(rest, frame.fd ? 64 : 8, frame)) {
    return {};
  }
  if (!IsWellFormed(frame)) return {};
  return frame;
}

}  // namespace plumb
