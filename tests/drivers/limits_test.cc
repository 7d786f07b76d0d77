#include "drivers/limits.h"

#include <catch2/catch.hpp>
#include <limits>

namespace plumb {
namespace {

TEST_CASE("effort limits") {
  constexpr double kInf = std::numeric_limits<double>::infinity(),
                   kNan = std::numeric_limits<double>::quiet_NaN();
  const JointLimits limits{.lower = -1, .upper = 2, .velocity = 10, .effort = 3};

  struct Case {
    double effort, position, velocity, expected;
  };
  for (const Case& c : {
           Case{1, 0, 0, 1}, Case{5, 0, 0, 3}, Case{-5, 0, 0, -3}, Case{1, 2.1, 0, 0}, Case{-1, 2.1, 0, -1},
           Case{-5, 2.1, 0, -3},                                               // above: only downwards
           Case{-1, -1.1, 0, 0}, Case{1, -1.1, 0, 1},                          // below: only upwards
           Case{1, 0, 10.1, 0}, Case{-1, 0, 10.1, -1}, Case{-1, 0, -10.1, 0},  // too fast: only brake
           Case{1, 2.1, -10.1, 0}, Case{-1, 2.1, -10.1, 0},  // coming back too fast: nothing
           Case{1, 2, 10, 1}, Case{-1, -1, -10, -1},         // at the limits is within
       }) {
    INFO(c.effort << " at " << c.position << ", " << c.velocity);
    const auto effort = LimitEffort(c.effort, c.position, c.velocity, limits);
    REQUIRE(effort);
    CHECK(*effort == c.expected);
  }
  for (const double bad : {kNan, kInf, -kInf}) {
    CHECK_FALSE(LimitEffort(bad, 0, 0, limits));
    CHECK_FALSE(LimitEffort(0, bad, 0, limits));
    CHECK_FALSE(LimitEffort(0, 0, bad, limits));
  }
  const JointLimits continuous{.lower = -kInf, .upper = kInf, .velocity = 10, .effort = 3};
  CHECK(*LimitEffort(1, 1e6, 0, continuous) == 1);
}

}  // namespace
}  // namespace plumb
