#include "estimator/moved_by_hand.h"

#include <catch2/catch.hpp>

#include "common/special_numbers.h"

namespace plumb {
namespace {

TEST_CASE("a robot was moved where a reading is beyond the limit and beyond its doubt") {
  CHECK(MovedByHand(0.21, 0.2, 0.01));
  CHECK(MovedByHand(-0.21, 0.2, 0.01));
  CHECK_FALSE(MovedByHand(0.19, 0.2, 0.01));
  CHECK_FALSE(MovedByHand(0.49, 0.2, 0.1));  // within five standard deviations
  CHECK(MovedByHand(-0.51, 0.2, 0.1));
  CHECK_FALSE(MovedByHand(kNaN, 0.2, 0.01));
}

}  // namespace
}  // namespace plumb
