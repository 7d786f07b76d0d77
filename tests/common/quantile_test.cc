#include "common/quantile.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace plumb {
namespace {

TEST_CASE("quantiles are interpolated") {
  CHECK(Quantile({1, 2, 4}, 0) == 1);
  CHECK(Quantile({1, 2, 4}, 0.5) == 2);
  CHECK(Quantile({1, 2, 4}, 0.75) == 3);
  CHECK(Quantile({1, 2, 4}, 1) == 4);
  CHECK(Quantile({7}, 0.3) == 7);
  CHECK(std::isnan(Quantile({}, 0.5)));
}

}  // namespace
}  // namespace plumb
