#pragma once

#include <cstdint>
#include <cstring>
#include <string_view>

#include "common/checked_file.h"

namespace plumb {

/// The kind of a file (common/checked_file.h), for other contents: of whatever version it is by
/// now.
inline FileKind KindOf(std::string_view file) {
  uint32_t version;
  std::memcpy(&version, file.data() + 8, sizeof version);
  return {file.substr(0, 8), version, ""};
}

}  // namespace plumb
