#include "common/sealed.h"

#include <fmt/format.h>

#include <boost/crc.hpp>
#include <cstring>

namespace plumb {
namespace {

constexpr size_t kMagic = 8, kHead = kMagic + 2 * sizeof(uint32_t);

uint32_t Crc(std::string_view content) {
  boost::crc_32_type crc;
  crc.process_bytes(content.data(), content.size());
  return crc.checksum();
}

}  // namespace

std::string Sealed(const Seal& seal, std::string_view content) {
  std::string bytes(seal.magic);
  const uint32_t crc = Crc(content);
  bytes.append(reinterpret_cast<const char*>(&seal.version), sizeof seal.version);
  bytes.append(reinterpret_cast<const char*>(&crc), sizeof crc);
  return bytes.append(content);
}

std::string_view Unsealed(const Seal& seal, std::string_view bytes) {
  if (bytes.size() < kHead || !bytes.starts_with(seal.magic))
    throw SealError(fmt::format("is not {}", seal.what));
  uint32_t version = 0, crc = 0;
  std::memcpy(&version, bytes.data() + kMagic, sizeof version);
  std::memcpy(&crc, bytes.data() + kMagic + sizeof version, sizeof crc);
  if (version != seal.version)
    throw SealError(fmt::format("has version {}, not {}", version, seal.version));
  const std::string_view content = bytes.substr(kHead);
  if (crc != Crc(content)) throw SealError("is damaged");
  return content;
}

}  // namespace plumb
