#include <catch2/catch.hpp>
#include <cmath>
#include <string>

#include "tests/calibrator/motion/csv_tables.h"
#include "tests/calibrator/synthetic.h"

namespace plumb {
namespace {

TEST_CASE("rows follow each other if a state is what the row before led to, noise allowed") {
  SECTION("the very same reading: its noise is in both") {
    const Log log = ReadTable(NextTable(0.05, 50, 0));
    REQUIRE(log.rollouts.size() == 1);
    REQUIRE(log.rollouts[0].transitions.size() == 50);
    for (const Transition& t : log.rollouts[0].transitions) {
      CHECK(std::isnan(t.q_sd(0)));
      CHECK(t.duration() == 0.05);
    }
    CHECK(log.rollouts[0].transitions[49].step == 49);
  }
  SECTION("noise on s' alone: s is exact") {
    const Log log = ReadTable(NextTable(0.05, 50, 0.01));
    REQUIRE(log.rollouts.size() == 1);
    CHECK(log.rollouts[0].transitions.size() == 50);
    for (const Transition& t : log.rollouts[0].transitions) CHECK(t.q_sd(0) == 0);
  }
  SECTION("unconnected transitions stay so, even where they happen to be near") {
    const Log log = ReadTable(NextTable(0.05, 2000, 0, true));
    CHECK(log.rollouts.size() == 2000);
    CHECK(log.drops.total() == 0);
    CHECK(log.rollouts[1999].episode == 1999);
  }
  SECTION("at whatever times they were made") {
    CHECK(ReadTable(NextTable(0.7, 20, 0, true)).rollouts.size() == 20);
  }
  SECTION("at a pace that is nearly the period") {
    const Log log = ReadTable(NextTable(0.055, 20, 0));
    CHECK(log.rollouts[0].transitions[3].duration() == Approx(0.055));
    CHECK(log.rollouts[0].transitions[19].duration() == 0.05);  // nobody knows
  }
}

TEST_CASE(
    "what cannot be used is dropped and counted, and splits an episode or leaves a gap in its "
    "steps") {
  const std::string head = "t,q/pivot,v/pivot,u/pivot\n";
  SECTION("states and actions that are not known") {
    const Log log = ReadTable(
        head +
        "0,0.1,0,1\n0.05,0.2,nan,1\n0.1,0.3,0,1\n0.15,0.4,0,\n0.2,0.5,0,0\n0.25,,,0\n0.3,1,0,0\n");
    REQUIRE(log.rollouts.size() == 1);
    REQUIRE(log.rollouts[0].transitions.size() == 2);
    CHECK(log.rollouts[0].transitions[0].step == 0);
    CHECK(log.rollouts[0].transitions[0].next_q(0) == 0.2);
    CHECK(std::isnan(log.rollouts[0].transitions[0].next_v(0)));
    CHECK(log.rollouts[0].transitions[1].step == 2);
    CHECK(log.drops.not_finite == 4);
    CHECK(log.drops.total() == 4);
  }
  SECTION("a gap in time") {
    const Log log = ReadTable(head + "0,0.1,0,1\n0.05,0.2,0,1\n0.25,0.3,0,1\n0.3,0.4,0,0\n");
    REQUIRE(log.rollouts.size() == 2);
    CHECK(log.rollouts[1].transitions[0].step == 0);
    CHECK(log.drops.late == 1);
  }
  SECTION("what was applied before a gap in time, where actions act late") {
    const Log log = ReadTable(
        head + "0,0.1,0,1\n0.05,0.2,0,1\n0.25,0.3,0,1\n0.3,0.4,0,0\n0.35,0.5,0,0\n", Pendulum());
    REQUIRE(log.rollouts.size() == 2);
    CHECK(log.rollouts[1].transitions[0].step == 1);
    CHECK(log.rollouts[1].transitions[0].efforts[0].effort(0) == 1);
    CHECK(log.drops.late == 1);
    CHECK(log.drops.gap == 1);
  }
  SECTION("a part at another rate") {
    const Log log =
        ReadTable(head + "0,0.1,0,1\n0.05,0.2,0,1\n0.06,0.3,0,1\n0.07,0.4,0,0\n0.12,0.5,0,0\n");
    CHECK(log.rollouts.size() == 2);
    CHECK(log.drops.late == 2);
  }
  SECTION("ends of episodes") {
    const Log log = ReadTable(
        "t,q/pivot,v/pivot,u/"
        "pivot,terminated,truncated\n0,1,0,1,0,0\n0.05,2,0,1,1,0\n0.1,3,0,1,0,0\n"
        "0.15,4,0,0,False,True\n0.15,5,0,0,,0\n0.2,6,0,0,0,0\n");
    REQUIRE(log.rollouts.size() == 3);
    CHECK(log.rollouts[2].transitions[0].next_q(0) == 6);
    CHECK(log.drops.total() == 0);
  }
}

TEST_CASE("a table of one transition") {
  CHECK(
      ReadTable("t,q/pivot,v/pivot,u/pivot\n0,1,0,1\n0.05,2,0,1").rollouts[0].transitions.size() ==
      1);
  CHECK(ReadTable("t,q/pivot,v/pivot,u/pivot,next_q/pivot,next_v/pivot\n7,1,0,1,2,nan\n")
            .rollouts[0]
            .transitions.size() == 1);
}

}  // namespace
}  // namespace plumb
