#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <span>
#include <string_view>

namespace plumb {

/// The signature of a message that its sender and its receivers share a key for, which nobody else
/// knows:
///
///   BLAKE2b-256 with that key, of some words, which say where the message belongs, a zero byte
///   behind each, and of the message
///
/// (RFC 7693; libsodium's crypto_generichash). What signs and what judges messages is Seal.
using Signature = std::array<uint8_t, 32>;

/// A shared key of 256 bits. Thread-safe (immutable).
class SigningKey {
 public:
  /// @param file 64 hexadecimal digits in one line, as MakeKeyFile writes them.
  /// @throws std::runtime_error naming the file, what is wrong and the cure, if it cannot be read,
  /// holds anything else, or may be read or written by anybody but its owner.
  explicit SigningKey(const std::filesystem::path& file);
  SigningKey(const SigningKey&) = default;
  SigningKey& operator=(const SigningKey&) = default;
  ~SigningKey();  ///< forgets it

  /// @param words none with a zero byte in it.
  Signature Sign(std::initializer_list<std::string_view> words,
                 std::span<const uint8_t> message) const noexcept;

 private:
  std::array<uint8_t, 32> key_;
};

/// Makes a key by the kernel's random numbers, in a new file that only its owner may read (mode
/// 0600).
/// @throws std::runtime_error naming the file; if there is one already, it stays as it is.
void MakeKeyFile(const std::filesystem::path& file);

}  // namespace plumb
