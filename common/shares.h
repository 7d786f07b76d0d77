#pragma once

#include <cstdint>

namespace plumb {

/// Where the part-th of so many parts of `count` items begins, which are as equal as can be: 0 for
/// the first, `count` for the one after the last. Thread-safe.
inline int ShareBegin(int count, int part, int parts) {
  return static_cast<int>(int64_t{count} * part / parts);
}

}  // namespace plumb
