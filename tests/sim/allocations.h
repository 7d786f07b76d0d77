#pragma once

#include <cstdint>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define PLUMB_COUNTS_ALLOCATIONS 0
#else
#define PLUMB_COUNTS_ALLOCATIONS 1
#endif

namespace plumb {

/// Allocations made so far by the calling thread, by operator new or by malloc, which Eigen calls
/// directly. Always 0 under a sanitizer, which has an allocator of its own.
int64_t Allocations();

}  // namespace plumb
