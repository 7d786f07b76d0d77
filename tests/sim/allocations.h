#pragma once

#include <cstdint>

namespace plumb {

/// Allocations made so far by the calling thread, by operator new or by malloc, which Eigen calls directly.
/// Always 0 under a sanitizer, which has an allocator of its own.
int64_t Allocations();

}  // namespace plumb
