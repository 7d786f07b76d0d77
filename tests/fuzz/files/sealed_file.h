#pragma once

#include <cstdint>
#include <cstring>
#include <string_view>

#include "common/sealed.h"

namespace plumb {

/// The seal of a file (common/sealed.h), for other contents: of whatever version it is by now.
inline Seal SealOf(std::string_view file) {
  uint32_t version;
  std::memcpy(&version, file.data() + 8, sizeof version);
  return {file.substr(0, 8), version, ""};
}

}  // namespace plumb
