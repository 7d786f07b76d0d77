#include "tests/sim/allocations.h"

#include <cstdlib>

#if PLUMB_COUNTS_ALLOCATIONS
namespace {
thread_local int64_t allocations = 0;
}

extern "C" {
void* __libc_malloc(size_t size);  // glibc's own, beneath what this file replaces

void* malloc(size_t size) noexcept {
  ++allocations;
  return __libc_malloc(size);
}
}
#endif

namespace plumb {

#if PLUMB_COUNTS_ALLOCATIONS
int64_t Allocations() { return allocations; }
#else
int64_t Allocations() { return 0; }
#endif

}  // namespace plumb
