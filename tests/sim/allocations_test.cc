#include "tests/sim/allocations.h"

#include <Eigen/Core>
#include <catch2/catch.hpp>
#include <memory>

namespace plumb {

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
