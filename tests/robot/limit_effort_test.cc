#include "robot/limit_effort.h"

#include <catch2/catch.hpp>

#include "common/special_numbers.h"

namespace plumb {
namespace {

double Limited(double wish, double position, double velocity, const JointLimits& limits,
               double sent = 0) {
  const auto effort = LimitEffort(
      wish, {.position = position, .velocity = velocity, .effort_sent = sent, .elapsed = 0.01},
      limits);
  REQUIRE(effort);
  return *effort;
}

TEST_CASE("effort, position and velocity limits") {
  const JointLimits limits{.lower = -1, .upper = 2, .velocity = 10, .effort = 3};
  struct Case {
    double effort, position, velocity, expected;
  };
  for (const Case& c : {
           Case{1, 0, 0, 1}, Case{5, 0, 0, 3}, Case{-5, 0, 0, -3}, Case{1, 2.1, 0, 0},
           Case{-1, 2.1, 0, -1},
           // above: only downwards
           Case{-5, 2.1, 0, -3},
           // below: only upwards
           Case{-1, -1.1, 0, 0}, Case{1, -1.1, 0, 1},
           // too fast: only brake
           Case{1, 0, 10.1, 0}, Case{-1, 0, 10.1, -1}, Case{-1, 0, -10.1, 0},
           Case{1, 2.1, -10.1, 0}, Case{-1, 2.1, -10.1, 0},  // coming back too fast: nothing
           Case{3, 2, 0, 3}, Case{-3, -1, 0, -3},            // at the limit is within
       }) {
    INFO(c.effort << " at " << c.position << ", " << c.velocity);
    CHECK(Limited(c.effort, c.position, c.velocity, limits) == c.expected);
  }
  for (const double bad : {kNaN, kInfinity, -kInfinity}) {
    CHECK_FALSE(LimitEffort(bad, {0, 0, 0, 0.01}, limits));
    CHECK_FALSE(LimitEffort(0, {bad, 0, 0, 0.01}, limits));
    CHECK_FALSE(LimitEffort(0, {0, bad, 0, 0.01}, limits));
  }
  const JointLimits continuous{
      .lower = -kInfinity, .upper = kInfinity, .velocity = kInfinity, .effort = 3};
  CHECK(Limited(3, 1e6, 1e6, continuous) == 3);
}

TEST_CASE("efforts towards a position limit fade within its margin") {
  const JointLimits limits{.lower = -1, .upper = 2, .velocity = 10, .effort = 4, .margin = 0.5};
  struct Case {
    double effort, position, expected;
  };
  for (const Case& c : {
           Case{4, 1.5, 4},
           Case{4, 1.75, 2},
           Case{4, 1.875, 1},
           Case{4, 2, 0},
           Case{4, 2.5, 0},
           Case{1, 1.75, 1},  // less than what is left of it
           Case{-4, 1.75, -4},
           Case{-4, 2, -4},  // away from it
           Case{-4, -0.5, -4},
           Case{-4, -0.75, -2},
           Case{-4, -1, 0},
           Case{4, -1, 4},
       }) {
    INFO(c.effort << " at " << c.position);
    CHECK(Limited(c.effort, c.position, 0, limits) == Approx(c.expected));
  }
}

TEST_CASE("efforts that make a joint faster fade before its velocity limit") {
  const JointLimits limits{.lower = -1, .upper = 2, .velocity = 10, .effort = 4};
  struct Case {
    double effort, velocity, expected;
  };
  for (const Case& c : {
           Case{4, 9.5, 4},
           Case{4, 9.75, 2},
           Case{4, 10, 0},
           Case{-4, 9.75, -4},
           Case{-4, 20, -4},
           Case{-4, -9.5, -4},
           Case{-4, -9.75, -2},
           Case{-4, -10, 0},
           Case{4, -9.75, 4},
       }) {
    INFO(c.effort << " at " << c.velocity);
    CHECK(Limited(c.effort, 0, c.velocity, limits) == Approx(c.expected).margin(1e-12));
  }
}

TEST_CASE("an effort grows at its rate and falls at once") {
  const JointLimits limits{.lower = -kInfinity,
                           .upper = kInfinity,
                           .velocity = kInfinity,
                           .effort = 3,
                           .effort_rate = 50};
  struct Case {
    double wish, sent, expected;
  };
  for (const Case& c : {
           // 0.5 in the 10 ms
           Case{2, 0, 0.5},
           Case{2, 1, 1.5},
           Case{2, 1.8, 2},
           Case{-2, 0, -0.5},
           Case{-2, -1, -1.5},
           Case{0, 3, 0},
           Case{0, -3, 0},
           Case{0.1, 3, 0.1},
           Case{-0.1, -3, -0.1},
           Case{-3, 3, -0.5},
           Case{3, -3, 0.5},  // through zero
           Case{9, 2.9, 3},
       }) {
    INFO(c.wish << " after " << c.sent);
    CHECK(Limited(c.wish, 0, 0, limits, c.sent) == Approx(c.expected));
  }
  // The other limits do not wait for it.
  JointLimits all = limits;
  all.upper = 1;
  CHECK(Limited(3, 1.1, 0, all, 3) == 0);
}

}  // namespace
}  // namespace plumb
