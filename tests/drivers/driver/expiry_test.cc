// How long a torque outlives the commands: never longer than expiry and one cycle.

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "common/random.h"
#include "tests/drivers/driver/rig.h"

namespace plumb {
namespace {

/// Commands that come at instants of their own, in no relation to the driver's cycle, and a wire to
/// look at.
struct Commander : Rig {
  Commander() {
    on_step = [this] {
      // Between this millisecond and the one before.
      while (next_command <= now && next_command <= last_command_due) {
        joint_command_t command = MakeCommand(1);
        command.expiry = own_expiry;
        driver->OnCommand(command, next_command, kEpoch + next_command);
        arrived = next_command;
        next_command += period;
      }
    };
    accept = [this](const std::vector<Frame>& frames) {
      for (const Frame& frame : frames) {
        if (frame.id == 0x02E) (ToText(frame) == "02E#00000000" ? zero_at : torque_at) = now;
      }
      return static_cast<int>(frames.size());
    };
  }

  int64_t period = 5000, next_command = 0, last_command_due = 0, own_expiry = 0;  // [us]
  // the last command
  int64_t arrived = 0;
  int64_t torque_at = 0, zero_at = 0;  // the last torque frames with and without torque
};

TEST_CASE(
    "from the last command to zero torque on the wire: at most expiry and one cycle, in 1000 of "
    "1000 "
    "trials") {
  Commander rig;
  rig.settings.watchdog = 0;  // nobody but the driver ends the torque
  rig.Start();
  REQUIRE(rig.Arm());
  rig.commanding = false;
  Random random(1);
  int64_t longest = 0, shortest = 1'000'000;
  for (int trial = 0; trial < 1000; ++trial) {
    rig.cycle_phase = 1000 * (random.Bits() % 5);
    rig.period = 1000 + random.Bits() % 50'000;
    // A command may ask for less time than the driver's expiry, and cannot have more.
    rig.own_expiry = trial % 3 == 0   ? 0
                     : trial % 3 == 1 ? 20'000 + random.Bits() % 80'000
                                      : 1'000'000;
    const int64_t expiry =
        rig.own_expiry == 0 ? 100'000 : std::min<int64_t>(rig.own_expiry, 100'000);
    rig.next_command = rig.now + 1 + random.Bits() % 5000;
    rig.last_command_due = rig.now + 60'000 + random.Bits() % 20'000;
    rig.Run(82 + 100 + 10);
    INFO("trial " << trial << ": " << rig.Reason());
    REQUIRE(rig.driver->state() == DriveState::kArmed);
    REQUIRE(rig.torque_at > rig.now - 192'000);  // there was a torque in this trial
    CHECK(rig.torque_at - rig.arrived <= expiry);
    CHECK(rig.drives[0].Torque() == 0);
    const int64_t first_zero = rig.torque_at + 5000;  // it sends a torque, or zero, in each cycle
    CHECK(rig.zero_at >= first_zero);
    CHECK(first_zero - rig.arrived <= expiry + 5000);
    longest = std::max(longest, first_zero - rig.arrived - expiry);
    shortest = std::min(shortest, first_zero - rig.arrived - expiry);
  }
  // The trials are not all the same: those that just miss a cycle, and those that just do not.
  CHECK(longest > 4900);
  CHECK(shortest < 100);
}

}  // namespace
}  // namespace plumb
