#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace plumb {

/// LCM's types as bytes, and back: what LCM carries, without a seal. All functions are thread-safe
/// for different arguments.
///
/// @param buffer is overwritten, so that it is allocated once. @return the whole of it.
template <class Message>
std::span<const uint8_t> Encode(const Message& message, std::vector<uint8_t>& buffer) {
  buffer.resize(static_cast<size_t>(message.getEncodedSize()));
  message.encode(buffer.data(), 0, static_cast<int>(buffer.size()));
  return buffer;
}

template <class Message>
std::vector<uint8_t> Encode(const Message& message) {
  std::vector<uint8_t> bytes;
  Encode(message, bytes);
  return bytes;
}

/// @param message undefined where it fails.
/// @return false if it is another type, another version's, or has another length.
template <class Message>
bool Decode(std::span<const uint8_t> bytes, Message& message) {
  const int length = static_cast<int>(bytes.size());
  return message.decode(bytes.data(), 0, length) == length;
}

}  // namespace plumb
