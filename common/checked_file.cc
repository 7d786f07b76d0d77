#include "common/checked_file.h"

#include <fmt/format.h>

#include <boost/crc.hpp>
#include <cstring>

namespace plumb {
namespace {

constexpr size_t kMagicSize = 8, kCheckedHead = kMagicSize + 2 * sizeof(uint32_t);

uint32_t Crc(std::string_view content) {
  boost::crc_32_type crc;
  crc.process_bytes(content.data(), content.size());
  return crc.checksum();
}

}  // namespace

std::string WithChecksum(const FileKind& kind, std::string_view content) {
  std::string bytes(kind.magic);
  const uint32_t crc = Crc(content);
  bytes.append(reinterpret_cast<const char*>(&kind.version), sizeof kind.version);
  bytes.append(reinterpret_cast<const char*>(&crc), sizeof crc);
  return bytes.append(content);
}

std::string_view CheckedContent(const FileKind& kind, std::string_view bytes) {
  if (bytes.size() < kCheckedHead || !bytes.starts_with(kind.magic))
    throw DamagedFile(fmt::format("is not {}", kind.what));
  uint32_t version = 0, crc = 0;
  std::memcpy(&version, bytes.data() + kMagicSize, sizeof version);
  std::memcpy(&crc, bytes.data() + kMagicSize + sizeof version, sizeof crc);
  if (version != kind.version)
    throw DamagedFile(fmt::format("has version {}, not {}", version, kind.version));
  const std::string_view content = bytes.substr(kCheckedHead);
  if (crc != Crc(content)) throw DamagedFile("is damaged");
  return content;
}

}  // namespace plumb
