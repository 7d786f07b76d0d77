#include "tests/sim/allocations.h"

#include <Eigen/Core>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <memory>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define PLUMB_COUNTS_ALLOCATIONS 0
#else
#define PLUMB_COUNTS_ALLOCATIONS 1
#endif

namespace {
thread_local int64_t allocations = 0;
}

#if PLUMB_COUNTS_ALLOCATIONS
extern "C" {
void* __libc_malloc(size_t size);  // glibc's own, beneath what this file replaces

void* malloc(size_t size) noexcept {
  ++allocations;
  return __libc_malloc(size);
}
}
#endif

namespace plumb {

int64_t Allocations() { return allocations; }

#if PLUMB_COUNTS_ALLOCATIONS
TEST_CASE("allocations are counted, whether by new or by Eigen") {
  const int64_t before = Allocations();
  const auto memory = std::make_unique<double[]>(1000);
  CHECK(memory[999] == 0);
  CHECK(Allocations() == before + 1);
  const Eigen::VectorXd vector = Eigen::VectorXd::Zero(1000);
  CHECK(vector[999] == 0);
  CHECK(Allocations() == before + 2);
}
#endif

}  // namespace plumb
