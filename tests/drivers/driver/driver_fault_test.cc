#include "drivers/driver/driver.h"

#include <catch2/catch.hpp>

#include "tests/drivers/driver/rig.h"

namespace plumb {
namespace {

using Catch::Matchers::Contains;
using Catch::Matchers::EndsWith;
using Catch::Matchers::Equals;
using Catch::Matchers::StartsWith;

// Of the encoder estimates of that id the position becomes none.
auto NotANumber(uint32_t id) {
  return [id](Frame& frame) {
    if (frame.id == id) frame.data[3] = 0x7F, frame.data[2] = 0xC0;
    return true;
  };
}

TEST_CASE("drives it must not arm") {
  Rig rig;
  SECTION("firmware 0.5") {
    rig.settings.version = {2, 3, 6, 56, 0, 5, 6, 0};
    rig.Start();
    CHECK_FALSE(rig.Arm());
    CHECK_THAT(rig.Reason(), Contains("its firmware is 0.5, this driver speaks 0.6"));
  }
  SECTION("no answer to the question for its version") {
    rig.to_drive = [](Frame& frame) { return frame.id != 0x20; };
    rig.Start();
    CHECK_FALSE(rig.Arm());
    CHECK_THAT(rig.Reason(), Contains("does not answer Get_Version"));
  }
  SECTION("one that stays idle") {
    rig.to_drive = [](Frame& frame) { return frame.id != 0x27 || frame.data[0] != 8; };
    rig.Start();
    CHECK_FALSE(rig.Arm());
    CHECK_THAT(rig.Reason(), Equals("pivot: it stays in IDLE (no error; success)"));
  }
  CHECK(rig.driver->state() == DriveState::kFault);
  rig.Run(200);
  CHECK_FALSE(rig.drives[0].armed());
  CHECK(rig.driver->confirmed_idle());
}

TEST_CASE("a drive that stops working stops the robot, with the reason") {
  Rig rig(2);
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(50);
  const char *expected = "", *and_ends = "";
  int64_t at_most = 0;
  SECTION("watchdog in the heartbeat") {
    rig.Inject("041#0000000101030000");
    expected = "knee1: the drive went to IDLE: watchdog timer expired (disarmed)";
    at_most = 5;
  }
  SECTION("an error while in closed loop") {
    rig.Inject("041#0004000008000000");
    expected = "knee1: the drive reports: DC bus over-current";
    at_most = 5;
  }
  SECTION("no encoder estimates") {
    rig.to_driver = [](Frame& frame) { return frame.id != 0x49; };
    expected = "knee1: no encoder estimate for 5";
    at_most = 60;
  }
  SECTION("no heartbeat") {
    rig.to_driver = [](Frame& frame) { return frame.id != 0x41; };
    expected = "knee1: no heartbeat for 5";
    at_most = 525;
  }
  SECTION("the drive's own watchdog, because our torques do not arrive") {
    rig.to_drive = [](Frame& frame) { return frame.id != 0x4E; };
    expected = "knee1: the drive went to IDLE: watchdog timer expired (disarmed)";
    at_most = 130;
  }
  SECTION("estimates that are no numbers") {
    rig.to_driver = NotANumber(0x49);
    expected = "knee1: no encoder estimate for 5";
    and_ends = " ms: what came last is not a number";
    at_most = 60;
  }
  const int64_t took = rig.RunUntil(DriveState::kFault);
  CHECK(took >= 0);
  CHECK(took <= at_most);
  CHECK_THAT(rig.Reason(), StartsWith(expected) && EndsWith(and_ends));
  rig.Run(10);
  CHECK(rig.drives[0].Torque() == 0);  // the healthy one, too
  rig.Run(300);
  CHECK_FALSE(rig.drives[0].armed());
  rig.to_drive = nullptr;
  rig.Run(300);
  CHECK_FALSE(rig.drives[1].armed());
}

TEST_CASE(
    "estimates that are no numbers keep the robot from being armed, and are told from silence") {
  Rig rig;
  rig.to_driver = NotANumber(0x29);
  rig.Start();
  CHECK_FALSE(rig.Arm());
  CHECK(rig.Reason() == "ARM refused: pivot: no encoder estimates: what came last is not a number");
  rig.to_driver = nullptr;
  CHECK(rig.Arm());
}

TEST_CASE("a person's stop is told from a fault") {
  Rig rig;
  rig.Start();
  CHECK_FALSE(rig.Status().stopped_by_request);
  REQUIRE(rig.Arm());
  rig.commanding = false;
  REQUIRE(rig.RunUntil(DriveState::kFault) >= 0);
  CHECK_FALSE(rig.Status().stopped_by_request);
  SECTION("DISARM after a fault") { rig.Request(driver_request_t::DISARM); }
  SECTION("ESTOP after a fault") { rig.Request(driver_request_t::ESTOP); }
  SECTION("DISARM while armed") {
    REQUIRE(rig.Arm());
    rig.Request(driver_request_t::DISARM);
  }
  rig.Run(100);
  CHECK(rig.Status().stopped_by_request);
  rig.Request(driver_request_t::ARM, 1'000'000'000);  // one that is refused changes nothing
  CHECK(rig.Status().stopped_by_request);
  REQUIRE(rig.Arm());
  CHECK_FALSE(rig.Status().stopped_by_request);
}

TEST_CASE("a drive that falls idle without an error is asked why") {
  Rig rig;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.to_driver = [&](Frame& frame) {
    if (frame.id == 0x23) frame = *FrameFromText("023#0000000000000001");
    return true;
  };
  rig.Inject("021#0000000001000000");
  rig.Run(5);
  CHECK(rig.driver->state() == DriveState::kFault);
  CHECK_THAT(rig.Reason(), Equals("pivot: the drive went to IDLE: no error (success)"));
  rig.Run(20);
  CHECK_THAT(rig.Status().joint_reason[0],
             Equals("the drive disarmed itself: watchdog timer expired"));
}

TEST_CASE("commands that are none change nothing and feed nobody") {
  Rig rig;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(20);
  rig.effort = std::numeric_limits<double>::quiet_NaN();
  rig.Run(100);
  CHECK(rig.drives[0].Torque() == 1);  // the last good one, until it expires
  CHECK(rig.Status().commands_rejected >= 19);
  rig.Run(20);
  CHECK(rig.drives[0].Torque() == 0);
  CHECK(rig.RunUntil(DriveState::kFault) >= 0);
  CHECK_THAT(rig.Reason(),
             StartsWith("commands refused: an effort is not a number (none taken for 25"));
}

TEST_CASE("a controller that began anew is taken up after the robot is armed again") {
  Rig rig;
  rig.Start();
  rig.sequence = 5'000'000;
  REQUIRE(rig.Arm(1));
  rig.Run(20);
  REQUIRE(rig.drives[0].Torque() == 1);
  rig.sequence = -1;
  CHECK(rig.RunUntil(DriveState::kFault) >= 0);
  CHECK_THAT(rig.Reason(), StartsWith("commands refused: their sequence is behind"));
  REQUIRE(rig.Arm(1));
  rig.Run(500);
  CHECK(rig.driver->state() == DriveState::kArmed);
  CHECK(rig.drives[0].Torque() == 1);
}

TEST_CASE("a drive that does not obey gets its emergency stop") {
  Rig rig;
  rig.settings.watchdog = 0;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.to_drive = [](Frame& frame) { return frame.id != 0x27 && frame.id != 0x2E; };
  rig.Request(driver_request_t::DISARM);
  rig.Run(100);
  CHECK(rig.drives[0].armed());
  CHECK_FALSE(rig.driver->confirmed_idle());
  rig.Run(400);
  CHECK(rig.drives[0].disarm_reason() == cansimple::kEstopRequested);
  CHECK(rig.driver->confirmed_idle());
}

TEST_CASE("a drive that is found armed is disarmed") {
  Rig rig;
  rig.settings.watchdog = 0;
  rig.Start();
  for (const char* text : {"038#00", "02B#0100000001000000", "027#08000000", "02E#0000803F"}) {
    rig.drives[0].OnFrame(*FrameFromText(text), rig.now);
  }
  REQUIRE(rig.drives[0].Torque() == 1);
  rig.Run(30);
  CHECK_FALSE(rig.drives[0].armed());
}

TEST_CASE("the bus fails and comes back, the robot does not by itself") {
  Rig rig;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(20);
  const char* expected = "";
  SECTION("link down") {
    rig.driver->OnLink(0, LinkState::kDown);
    expected = "the CAN interface is down";
  }
  SECTION("interface removed") {
    rig.driver->OnLink(0, LinkState::kGone);
    expected = "the CAN interface is gone";
  }
  SECTION("bus-off") {
    rig.Inject("20000040#0000000000000000");
    expected = "the CAN controller went bus-off";
  }
  CHECK(rig.driver->state() == DriveState::kFault);
  CHECK(rig.Reason() == expected);
  rig.Run(5);
  CHECK(rig.Sent() == std::vector<std::string>{"02E#00000000", "027#0100000000000000"});
  rig.driver->OnLink(0, LinkState::kUp);
  rig.Inject("20000100#0000000000000000");
  rig.Run(500);
  CHECK(rig.Status().buses[0].up);
  CHECK(rig.driver->state() == DriveState::kFault);
  CHECK(rig.drives[0].Torque() == 0);
  CHECK(rig.Arm());
}

TEST_CASE("nobody acknowledges") {
  Rig rig;
  rig.Start();
  REQUIRE(rig.Arm(1));
  for (int i = 0; i < 16; ++i) rig.Inject("20000020#0000000000000000");
  CHECK(rig.driver->state() == DriveState::kArmed);
  rig.Inject("20000020#0000000000000000");
  CHECK(rig.driver->state() == DriveState::kFault);
  CHECK_THAT(rig.Reason(), Contains("acknowledges"));
}

TEST_CASE("a bus that accepts nothing for ten cycles is a fault") {
  Rig rig;
  rig.settings.watchdog = 0;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(20);
  rig.bus_full = true;
  rig.Run(45);
  CHECK(rig.driver->state() == DriveState::kArmed);
  rig.bus_full = false;
  rig.Run(5);
  rig.bus_full = true;
  CHECK(rig.RunUntil(DriveState::kFault) == 50);
  CHECK_THAT(rig.Reason(), Equals("the bus has not accepted frames in 10 cycles"));
  // Frames that were not accepted are not sent later: one disarm, not ten cycles of torques.
  rig.bus_full = false;
  rig.Run(60);
  CHECK_FALSE(rig.drives[0].armed());
}

TEST_CASE("frames that only look like ours are not") {
  Rig rig;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(20);
  const size_t states = rig.states.size();
  const int64_t rejected = rig.Status().buses[0].frames_rejected;
  for (const char* text : {"029#R8", "00000029#0000803F0000803F", "029##00000803F0000803F",
                           "20000001#0000000001000000", "021#R", "00000021#0000000001000000",
                           "021##00000000001000000"}) {
    rig.Inject(text);
  }
  while (rig.driver->NextState()) FAIL("a state from frames that are not ours");
  CHECK(rig.driver->state() == DriveState::kArmed);
  CHECK(rig.Status().buses[0].frames_rejected == rejected + 6);  // error frames are no frames
  for (const char* text : {"029#000080BE", "029#0000C07F00006040", "029#00008040000080FF",
                           "021#000000000800", "03E#", "029#"}) {
    rig.Inject(text);
  }
  while (rig.driver->NextState()) FAIL("a state from malformed frames");
  CHECK(rig.Status().buses[0].frames_rejected == rejected + 12);
  rig.Run(100);
  CHECK(rig.driver->state() == DriveState::kArmed);
  CHECK(rig.states.size() == states + 20);
}

}  // namespace
}  // namespace plumb
