#pragma once

#include "common/config.h"

namespace plumb {

/// Orders of magnitude beyond sense: numbers that would overflow elsewhere are mistakes here.
/// Constants: thread-safe.
inline constexpr Range kSanePositive{1e-12, 1e12}, kSaneNotNegative{0, 1e12};

}  // namespace plumb
