#include "common/median.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace plumb {
namespace {

TEST_CASE("a median is the middle value, or the mean of the middle two") {
  CHECK(Median({7}) == 7);
  CHECK(Median({9, -1, 4}) == 4);
  CHECK(Median({3, 1}) == 2);
  CHECK(Median({8, 100, 2, 3, 1, 5}) == 4);
  CHECK(Median({1, 1, 1, 5}) == 1);
  CHECK(Median({1, 2, INFINITY}) == 2);
  CHECK(std::isnan(Median({})));
}

}  // namespace
}  // namespace plumb
