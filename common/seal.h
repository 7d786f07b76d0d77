#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "common/signature.h"

namespace plumb {

/// What a process of ours puts behind each message that it says on LCM: who says it, and with a key
/// the proof. Decoders of other programs do not see it: they stop where the message ends.
///
///   "PLUMSEAL"  int64 run  int64 sender  int64 process  int64 counter  byte signature[32]
///
/// all of it big-endian, as LCM has its numbers.
struct Seal {
  int64_t run = 0;      ///< for whom it is said, see Identity; 0 = for anybody
  int64_t sender = 0;   ///< random number of the process that says it, another one in each start
  int64_t process = 0;  ///< its ProcessNumber; 0 = not told
  /// Greater than in every message that the process has said before: the real time of saying [us],
  /// or one more than the one before where that is greater, so that it rises over restarts and from
  /// sender to sender, too.
  int64_t counter = 0;
  Signature signature{};  ///< zeros without a key
};
inline constexpr size_t kSealSize = 8 + 4 * 8 + sizeof(Signature);

/// The seal of a message as it was received; none if it has no seal. Thread-safe, as all functions
/// here; they neither allocate nor throw.
std::optional<Seal> FindSeal(std::span<const uint8_t> bytes) noexcept;
/// The message alone.
std::span<const uint8_t> Unsealed(std::span<const uint8_t> bytes) noexcept;

/// Writes a seal into the last kSealSize bytes of a message. @param key null: its signature stays
/// as it is. @param robot, bus, channel to which the signature binds the message.
void WriteSeal(Seal seal, const SigningKey* key, std::string_view robot, std::string_view bus,
               std::string_view channel, std::span<uint8_t> message) noexcept;
/// Whether a message that has a seal was signed with this key, for this robot, bus and channel.
bool Genuine(const SigningKey& key, std::string_view robot, std::string_view bus,
             std::string_view channel, std::span<const uint8_t> message) noexcept;

}  // namespace plumb
