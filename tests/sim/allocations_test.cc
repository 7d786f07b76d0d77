#include "tests/sim/allocations.h"

#include <Eigen/Core>
#include <catch2/catch.hpp>
#include <memory>

namespace plumb {

#if PLUMB_COUNTS_ALLOCATIONS
namespace {
// Else the compiler may do without the memory.
void Escape(const double* memory) { asm volatile("" : : "r"(memory) : "memory"); }
}  // namespace

TEST_CASE("allocations are counted, whether by new or by Eigen") {
  const int64_t before = Allocations();
  const auto memory = std::make_unique<double[]>(1000);
  Escape(memory.get());
  CHECK(Allocations() == before + 1);
  const Eigen::VectorXd vector = Eigen::VectorXd::Zero(1000);
  Escape(vector.data());
  CHECK(Allocations() == before + 2);
}
#endif

}  // namespace plumb
