#include "tests/sim/allocations.h"

#include <cstdlib>

#if PLUMB_COUNTS_ALLOCATIONS
namespace {
thread_local int64_t allocations = 0;
}

// All ways to memory; glibc's own are beneath. GCC makes calloc of malloc and memset, and of new
// for what is over-aligned aligned_alloc.
extern "C" {
void* __libc_malloc(size_t size);
void* __libc_calloc(size_t count, size_t size);
void* __libc_realloc(void* memory, size_t size);
void* __libc_memalign(size_t alignment, size_t size);

void* malloc(size_t size) noexcept {
  ++allocations;
  return __libc_malloc(size);
}
void* calloc(size_t count, size_t size) noexcept {
  ++allocations;
  return __libc_calloc(count, size);
}
void* realloc(void* memory, size_t size) noexcept {
  ++allocations;
  return __libc_realloc(memory, size);
}
void* aligned_alloc(size_t alignment, size_t size) noexcept {
  ++allocations;
  return __libc_memalign(alignment, size);
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
