#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>

namespace plumb {

// What a program keeps for itself in a file, with a head that tells damage: eight characters that
// say what it is, a version, the CRC-32 of the rest (ISO 3309), and the rest. Numbers as this
// machine has them. Functions here are thread-safe.

/// "is damaged", "has version 3, not 7", "is not a trainer's checkpoint".
struct DamagedFile : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct FileKind {
  std::string_view magic;  ///< eight characters
  uint32_t version;
  const char* what;  ///< "a trainer's checkpoint"
};

std::string WithChecksum(const FileKind& kind, std::string_view content);
/// The content, which lives as long as the bytes. @throws DamagedFile if it is of another kind or
/// version, or damaged.
std::string_view CheckedContent(const FileKind& kind, std::string_view bytes);

}  // namespace plumb
