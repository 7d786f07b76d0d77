#include "cli/rearming.h"

#include <catch2/catch.hpp>

namespace plumb {
namespace {

struct Run {
  explicit Run(bool real = false) : rearming(real, "plumb arm", 0) {}
  /// A second later, and heard twice.
  Rearming::Advice Say(int8_t state, const std::string& reason = "") {
    driver.state = state, driver.reason = reason;
    const Rearming::Advice first = rearming.Next(driver, controller, now += 1'000'000);
    const Rearming::Advice again = rearming.Next(driver, controller, now);
    CHECK(again.lines.empty());
    CHECK_FALSE(again.arm);  // it has been asked just now
    return first;
  }
  Rearming::Advice Fault() {
    const Rearming::Advice advice = Say(driver_status_t::FAULT, "no command for 102 ms");
    Say(driver_status_t::ARMED);
    return advice;
  }

  Rearming rearming;
  driver_status_t driver{};
  controller_status_t controller{};
  int64_t now = 0;
};

TEST_CASE("a virtual robot is armed again, and it is said why it was disarmed") {
  Run run;
  CHECK(run.Say(driver_status_t::IDLE).arm);
  CHECK_FALSE(run.Say(driver_status_t::ARMED).arm);
  run.controller.phase = controller_status_t::HALTED;
  run.controller.reason = "the state is not valid";
  const Rearming::Advice advice = run.Fault();
  CHECK(advice.arm);
  CHECK(advice.lines ==
        std::vector<std::string>{"driver fault: no command for 102 ms; the controller has halted: "
                                 "the state is not valid"});
  CHECK(run.rearming.count() == 1);
}

TEST_CASE("not for ever, but where episodes come to an end between the faults") {
  Run run;
  for (int i = 0; i < 100; ++i) {
    run.controller.num_episodes = i % 3;
    CHECK_FALSE(run.Fault().give_up);
  }
  for (int i = 0; i < Rearming::kMost - 1; ++i) CHECK_FALSE(run.Fault().give_up);
  const Rearming::Advice advice = run.Fault();
  CHECK(advice.give_up);
  CHECK_FALSE(advice.arm);
  CHECK(run.rearming.count() == 100 + Rearming::kMost);
}

TEST_CASE("what a person has stopped, and a real robot, only a person starts") {
  SECTION("stopped") {
    Run run;
    run.driver.stopped_by_request = 1;
    const Rearming::Advice advice = run.Say(driver_status_t::IDLE);
    CHECK_FALSE(advice.arm);
    CHECK(advice.lines == std::vector<std::string>{"stopped by request. To go on: plumb arm"});
    run.driver.stopped_by_request = 0;
    CHECK(run.Say(driver_status_t::IDLE).arm);
  }
  SECTION("real") {
    Run run(true);
    CHECK_FALSE(run.Say(driver_status_t::IDLE).arm);
    for (int i = 0; i < 2 * Rearming::kMost; ++i) {
      const Rearming::Advice advice = run.Fault();
      CHECK_FALSE(advice.arm);
      CHECK_FALSE(advice.give_up);
      REQUIRE(advice.lines.size() == 2);
      CHECK(advice.lines[1] == "Look at the robot. To go on: plumb arm");
    }
  }
}

}  // namespace
}  // namespace plumb
