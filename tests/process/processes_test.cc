// Whichever other process stands still or is killed: no torque is on the bus for longer than expiry
// and one cycle after the last command was made, whoever lives on.

#include <algorithm>
#include <cmath>

#include "common/time_units.h"
#include "tests/process/stage.h"

namespace plumb {
namespace {

constexpr int kIdle = 1;  // CANSimple axis state

/// Stands still for longer than anybody waits, or is killed.
void Fail(Stage& stage, const std::string& name, bool killed) {
  if (killed) {
    stage.Kill(name);
  } else {
    stage.Stall(name, 2);
  }
}

TEST_CASE("a calibrator and a trainer that stand still or are killed are missed by nobody") {
  Stage stage(60);
  stage.Start("plumb-calibrator", {"--checkpoint", stage.folder / "calibrator"});
  stage.Start("plumb-trainer", {"--checkpoint", stage.folder / "trainer"});
  stage.RunWithTorque();
  // A torque is commanded anew in every control period.
  const int64_t period = Microseconds(stage.robot.task.period),
                cycle = Microseconds(stage.robot.driver.cycle);
  for (const bool killed : {false, true}) {
    for (const char* name : {"plumb-calibrator", "plumb-trainer"}) {
      INFO(name << (killed ? " is killed" : " stands still"));
      Fail(stage, name, killed);
      stage.longest_alone = 0;
      const int64_t begin = stage.Now();
      stage.Listen(1);
      CHECK(stage.last_torque_time > begin + Microseconds(1) - period);
      CHECK(stage.longest_alone > 0);
      CHECK(stage.longest_alone <= period + cycle);
    }
  }
}

TEST_CASE("a controller or an estimator that stands still or is killed") {
  const char* name = GENERATE("plumb-controller", "plumb-estimator");
  const bool killed = GENERATE(false, true);
  INFO(name << (killed ? " is killed" : " stands still"));
  Stage stage(61);
  stage.RunWithTorque();
  stage.longest_alone = 0;
  Fail(stage, name, killed);
  REQUIRE(stage.WaitForDriver(driver_status_t::FAULT, 5));
  REQUIRE(stage.WaitUntil([&] { return stage.axis_state == kIdle; }, 2));
  CHECK(stage.longest_alone <= Microseconds(stage.robot.driver.expiry + stage.robot.driver.cycle));
  const int64_t last_torque = stage.last_torque_time;
  stage.Listen(2);  // it wakes up meanwhile
  CHECK(stage.last_torque_time == last_torque);
}

}  // namespace
}  // namespace plumb
