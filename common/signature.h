#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace plumb {

/// A message that ends in `int64_t counter; byte signature[32];` can be signed with a key that its
/// sender and its receiver share and nobody else knows:
///
///   signature = BLAKE2b-256 with that key, of the channel's name, a zero byte, and the encoded
///   message before it
///
/// (RFC 7693; libsodium's crypto_generichash). The channel is in it, so that no message can pass
/// for one of another channel; the type is, because LCM encodes its fingerprint first. The counter
/// is the real time of signing [us], or one more than the one before where that is greater: it
/// rises in a process, over restarts, and from sender to sender.
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

  /// @param body the encoded message without the signature at its end.
  Signature Sign(std::string_view channel, std::span<const uint8_t> body) const noexcept;

 private:
  std::array<uint8_t, 32> key_;
};

/// Makes a key by the kernel's random numbers, in a new file that only its owner may read (mode
/// 0600).
/// @throws std::runtime_error naming the file; if there is one already, it stays as it is.
void MakeKeyFile(const std::filesystem::path& file);

/// Signs the messages of one channel. Not thread-safe.
class Signer {
 public:
  Signer(const SigningKey& key, std::string channel) : key_(key), channel_(std::move(channel)) {}

  /// Fills in the message's counter and signature; nothing else of it may change afterwards.
  /// @param real_utime real time, not scaled [us].
  template <class Message>
  void Sign(Message& message, int64_t real_utime) {
    message.counter = counter_ = std::max(counter_ + 1, real_utime);
    const int size = message.getEncodedSize();
    encoding_.resize(static_cast<size_t>(size));
    message.encode(encoding_.data(), 0, size);
    const Signature signature = key_.Sign(
        channel_, std::span(encoding_).first(encoding_.size() - sizeof message.signature));
    std::ranges::copy(signature, message.signature);
  }

 private:
  SigningKey key_;
  std::string channel_;
  int64_t counter_ = 0;
  std::vector<uint8_t> encoding_;
};

/// Judges the messages of one channel as they arrive. Neither allocates, blocks nor throws after
/// construction. Not thread-safe.
class Verifier {
 public:
  static constexpr int64_t kOldest =
      10'000'000;  ///< age at which a message is void, however it was held up [us]
  /// that the sender's clock may be ahead of ours [us]
  static constexpr int64_t kClockError = 1'000'000;

  /// @param start real time of the receiver's start [us]: what was signed before it is for an
  /// earlier run.
  Verifier(const SigningKey& key, std::string channel, int64_t start)
      : key_(key), channel_(std::move(channel)), newest_(start) {}

  /// @param encoding the message as it was received. @param real_utime real time, not scaled [us].
  /// @return why it must not be obeyed, a literal; empty if it was signed with the key, is no older
  /// than kOldest, and was signed later than every one that has been accepted before.
  std::string_view Judge(std::span<const uint8_t> encoding, int64_t real_utime) noexcept;

 private:
  SigningKey key_;
  std::string channel_;
  int64_t newest_;  // counter of the last message accepted
};

}  // namespace plumb
