// Frames that the transport does not take have not been sent: arming and stopping over a bus that
// refuses frames.

#include <algorithm>
#include <catch2/catch.hpp>
#include <utility>

#include "tests/drivers/driver/rig.h"

namespace plumb {
namespace {

/// Notes whether a drive was ever in closed loop in a mode other than torque control.
void Watch(Rig& rig, bool& wrong) {
  rig.on_step = [&] {
    for (const CanSimpleDevice& drive : rig.drives) {
      wrong = wrong || (drive.armed() && drive.control_mode() != cansimple::kTorqueControl);
    }
  };
}

/// A transport that takes the frames up to the first with the id.
int UpTo(const std::vector<Frame>& frames, uint32_t id) {
  return static_cast<int>(std::ranges::find(frames, id, &Frame::id) - frames.begin());
}

TEST_CASE("a mode that the transport refused is given again before the loop is closed") {
  Rig rig;
  int refusals = 0;
  rig.accept = [&](const std::vector<Frame>& frames) {
    const int count = UpTo(frames, 0x2B);
    if (count == static_cast<int>(frames.size()) || ++refusals > 3)
      return static_cast<int>(frames.size());
    return count;
  };
  bool wrong = false;
  rig.Start();
  Watch(rig, wrong);
  CHECK(rig.Arm(1));
  rig.Run(20);
  CHECK(refusals >= 4);
  CHECK_FALSE(wrong);
  CHECK(rig.drives[0].Torque() == 1);
}

TEST_CASE("a mode that is never accepted ends the arming, with the reason") {
  Rig rig;
  rig.accept = [&](const std::vector<Frame>& frames) { return UpTo(frames, 0x2B); };
  bool wrong = false;
  rig.Start();
  Watch(rig, wrong);
  CHECK_FALSE(rig.Arm());
  CHECK(rig.driver->state() == DriveState::kFault);
  CHECK(rig.Reason() == "the bus has not accepted frames in 10 cycles");
  CHECK_FALSE(wrong);
}

TEST_CASE("a mode that is refused every other cycle only delays the arming") {
  Rig rig(2);
  int cycle = 0;
  rig.accept = [&](const std::vector<Frame>& frames) {
    return ++cycle % 2 == 0 ? static_cast<int>(frames.size())
                            : std::min<int>(2, static_cast<int>(frames.size()));
  };
  bool wrong = false;
  rig.Start();
  Watch(rig, wrong);
  CHECK(rig.Arm(1));
  CHECK_FALSE(wrong);
}

TEST_CASE("one mode lost on the bus itself does not close the loop in another") {
  Rig rig;
  int seen = 0;
  rig.to_drive = [&](Frame& frame) { return frame.id != 0x2B || ++seen > 1; };
  bool wrong = false;
  rig.Start();
  Watch(rig, wrong);
  CHECK(rig.Arm());
  rig.Run(20);
  CHECK(seen == 2);
  CHECK_FALSE(wrong);
}

TEST_CASE("a drive that restarts while it is armed does not run in the mode it wakes up in") {
  const int after = GENERATE(1, 2);  // modes
  Rig rig;
  int modes = 0;
  rig.to_drive = [&](Frame& frame) { return modes += frame.id == 0x2B, true; };
  bool restarted = false, wrong = false;
  rig.Start();
  rig.on_step = [&] {
    wrong = wrong ||
            (rig.drives[0].armed() && rig.drives[0].control_mode() != cansimple::kTorqueControl);
    if (modes == after && !std::exchange(restarted, true)) rig.drives[0].Reboot(rig.now);
  };
  rig.Arm();
  rig.Run(20);
  CHECK(restarted);
  CHECK_FALSE(wrong);
}

TEST_CASE("many joints arm with few frames in each cycle") {
  const int joints = GENERATE(3, 6, 20);
  Rig rig(joints);
  const size_t most = std::max<size_t>(8, static_cast<size_t>(joints) + 2);
  size_t worst = 0;
  rig.accept = [&](const std::vector<Frame>& frames) {
    worst = std::max(worst, frames.size());
    return static_cast<int>(std::min(frames.size(), most));
  };
  bool wrong = false;
  rig.robot.buses[0].bit_rate = 1e7;  // more than one bus of 1 Mbit/s carries
  rig.Start();
  Watch(rig, wrong);
  CHECK(rig.Arm(1));
  rig.Run(20);
  CHECK(worst <= most);
  CHECK_FALSE(wrong);
  for (const CanSimpleDevice& drive : rig.drives) CHECK(drive.Torque() == 1);
}

TEST_CASE(
    "a stop that was refused is given again in the next cycle, to those who have not got it") {
  Rig rig(6);
  rig.settings.watchdog = 0;
  rig.settings.heartbeat_period = 100'000;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.accept = [](const std::vector<Frame>& frames) {
    return std::min<int>(4, static_cast<int>(frames.size()));
  };
  rig.Request(driver_request_t::DISARM);
  rig.Run(15);
  for (const CanSimpleDevice& drive : rig.drives) CHECK_FALSE(drive.armed());
}

TEST_CASE("an emergency stop is sent before a heartbeat can end it") {
  Rig rig;
  rig.Start();
  int estops = 0;
  rig.to_drive = [&](Frame& frame) { return estops += frame.id == 0x22, true; };
  rig.Run(300);
  REQUIRE(rig.driver->state() == DriveState::kIdle);
  rig.bus_full = GENERATE(false, true);
  rig.Request(driver_request_t::ESTOP);
  rig.Inject("021#0000000001000000");
  rig.Run(40);
  CHECK((estops == 0) == rig.bus_full);
  CHECK(rig.driver->confirmed_idle() != rig.bus_full);
  rig.bus_full = false;
  rig.Run(60);
  CHECK(estops >= 1);
  CHECK(rig.driver->confirmed_idle());
  CHECK(rig.drives[0].disarm_reason() == cansimple::kEstopRequested);
}

TEST_CASE("a drive that was armed and is not heard any more is not confirmed to be idle") {
  Rig rig;
  rig.Start();
  CHECK(rig.driver->confirmed_idle());
  rig.Run(300);
  REQUIRE(rig.Arm(1));
  bool silent = true;
  rig.to_driver = [&](Frame&) { return !silent; };
  rig.Run(1000);
  CHECK(rig.driver->state() == DriveState::kFault);
  rig.Request(driver_request_t::DISARM);
  rig.Run(2000);
  CHECK_FALSE(rig.driver->confirmed_idle());
  silent = false;
  rig.Run(100);
  CHECK(rig.driver->confirmed_idle());
  silent = true;  // known to be idle, then unplugged
  rig.Run(1000);
  CHECK(rig.driver->confirmed_idle());
}

TEST_CASE("a heartbeat from before the order to run was obeyed does not confirm that it is idle") {
  Rig rig;
  rig.settings.watchdog = 0;
  rig.Start();
  rig.Run(300);
  rig.Request(driver_request_t::ARM);
  const auto has_order = [&] {
    return std::ranges::any_of(rig.sent, [](const Frame& frame) { return frame.id == 0x27; });
  };
  for (int i = 0; i < 1000 && !has_order(); ++i) rig.Step();
  REQUIRE(has_order());
  rig.Request(driver_request_t::DISARM);
  rig.Inject("021#0000000001000000");
  rig.Step();
  CHECK_FALSE(rig.driver->confirmed_idle());
  rig.Run(4);
  CHECK_FALSE(rig.drives[0].armed());
}

TEST_CASE("once the clock is right again it can be armed again, and old requests stay void") {
  const int64_t wrong = GENERATE(-3'600'000'000, 3'600'000'000);  // [us]
  Rig rig;
  SECTION("it stops while the clock is wrong") {
    rig.Start();
    rig.set_back = wrong;
    REQUIRE(rig.Arm(1));
    rig.Request(driver_request_t::DISARM);
  }
  SECTION("it starts while the clock is wrong") {
    rig.set_back = wrong;
    rig.Start();
  }
  rig.Run(300);
  REQUIRE(rig.driver->state() != DriveState::kArmed);
  rig.set_back = 0;
  rig.Request(driver_request_t::ARM, 400'000);
  rig.Run(10);
  CHECK_THAT(rig.Reason(), Catch::Contains("it was made before the driver st"));
  CHECK(rig.Arm(1));
}

}  // namespace
}  // namespace plumb
