#include "common/seal.h"

#include <endian.h>
#include <sodium.h>

#include <array>
#include <cstring>

namespace plumb {
namespace {

constexpr std::string_view kSealMagic = "PLUMSEAL";

bool HasSeal(std::span<const uint8_t> bytes) noexcept {
  return bytes.size() >= kSealSize && std::memcmp(bytes.data() + bytes.size() - kSealSize,
                                                  kSealMagic.data(), kSealMagic.size()) == 0;
}

Signature SignatureOf(const SigningKey& key, std::string_view robot, std::string_view bus,
                      std::string_view channel, std::span<const uint8_t> message) noexcept {
  return key.Sign({robot, bus, channel}, message.first(message.size() - sizeof(Signature)));
}

}  // namespace

std::optional<Seal> FindSeal(std::span<const uint8_t> bytes) noexcept {
  if (!HasSeal(bytes)) return std::nullopt;
  std::array<uint64_t, 4> numbers;
  const uint8_t* at = bytes.data() + bytes.size() - kSealSize + kSealMagic.size();
  std::memcpy(numbers.data(), at, sizeof numbers);
  for (uint64_t& number : numbers) number = be64toh(number);
  Seal seal{static_cast<int64_t>(numbers[0]),
            static_cast<int64_t>(numbers[1]),
            static_cast<int64_t>(numbers[2]),
            static_cast<int64_t>(numbers[3]),
            {}};
  std::memcpy(seal.signature.data(), at + sizeof numbers, seal.signature.size());
  return seal;
}

std::span<const uint8_t> Unsealed(std::span<const uint8_t> bytes) noexcept {
  return HasSeal(bytes) ? bytes.first(bytes.size() - kSealSize) : bytes;
}

void WriteSeal(Seal seal, const SigningKey* key, std::string_view robot, std::string_view bus,
               std::string_view channel, std::span<uint8_t> message) noexcept {
  uint8_t* at = message.data() + message.size() - kSealSize;
  std::memcpy(at, kSealMagic.data(), kSealMagic.size());
  at += kSealMagic.size();
  for (const int64_t number : {seal.run, seal.sender, seal.process, seal.counter}) {
    const uint64_t network = htobe64(static_cast<uint64_t>(number));
    std::memcpy(at, &network, sizeof network);
    at += sizeof network;
  }
  if (key) seal.signature = SignatureOf(*key, robot, bus, channel, message);
  std::memcpy(at, seal.signature.data(), seal.signature.size());
}

bool Genuine(const SigningKey& key, std::string_view robot, std::string_view bus,
             std::string_view channel, std::span<const uint8_t> message) noexcept {
  if (!HasSeal(message)) return false;
  const Signature expected = SignatureOf(key, robot, bus, channel, message);
  return sodium_memcmp(expected.data(), message.data() + message.size() - expected.size(),
                       expected.size()) == 0;
}

}  // namespace plumb
