#include "drivers/driver/driver.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <numbers>

#include "tests/drivers/driver/rig.h"

namespace plumb {
namespace {

using Catch::Matchers::Contains;
using Catch::Matchers::Equals;
using Catch::Matchers::StartsWith;

constexpr double kTwoPi = 2 * std::numbers::pi;

TEST_CASE("arming follows the protocol's sequence and ends in torque control") {
  Rig rig;
  rig.Start();
  rig.Run(300);
  CHECK(rig.driver->state() == DriveState::kIdle);
  rig.Request(driver_request_t::ARM);
  std::vector<std::string> all;
  for (int i = 0; i < 12 && rig.driver->state() != DriveState::kArmed; ++i) {
    rig.Run(5);
    for (const std::string& text : rig.Sent()) all.push_back(text);
  }
  CHECK(rig.driver->state() == DriveState::kArmed);
  CHECK(rig.Reason().empty());
  if (all.back() == "037#R") all.pop_back();  // armed, it asks for the supply's voltage
  all.erase(std::remove(all.begin(), all.end(), "02E#00000000"), all.end());
  CHECK(all == std::vector<std::string>{"020#R", "038#00", "02B#0100000001000000",
                                        "02B#0100000001000000", "027#0800000000000000"});
  CHECK(rig.drives[0].armed());
  CHECK(rig.drives[0].Torque() == 0);
}

TEST_CASE("armed, it transmits the newest command in every cycle") {
  Rig rig;
  rig.Start();
  REQUIRE(rig.Arm(1.5));
  rig.Run(20);
  CHECK(rig.Sent() == std::vector<std::string>{"02E#0000C03F"});
  CHECK(rig.drives[0].Torque() == 1.5);
  // Three commands between two cycles: only the last is ever sent.
  rig.commanding = false;
  rig.Command(1);
  rig.Command(-1);
  rig.Command(-0.5);
  const int64_t before = rig.drives[0].setpoints();
  rig.Run(5);
  CHECK(rig.drives[0].Torque() == -0.5);
  CHECK(rig.drives[0].setpoints() == before + 1);
  // One that was overtaken on its way does not come back.
  joint_command_t old = rig.MakeCommand(2);
  old.sequence -= 2;
  rig.driver->OnCommand(old, rig.now, rig.utime());
  rig.Run(5);
  CHECK(rig.drives[0].Torque() == -0.5);
  CHECK(rig.Status().commands_rejected == 1);
}

TEST_CASE("efforts are limited, geared and turned") {
  Rig rig;
  rig.robot.joints[0].motor.gear = 4;
  rig.robot.joints[0].motor.sign = -1;
  rig.robot.joints[0].motor.offset = 0.5;
  rig.robot.joints[0].lower = -1;
  rig.robot.joints[0].upper = 1;
  rig.Start();
  REQUIRE(rig.Arm(9));
  rig.samples[0] = {0, 0};  // joint at 0.5
  rig.Run(20);
  CHECK(rig.drives[0].Torque() == -0.5);  // 2 Nm at the joint
  for (int i = 1; i <= 10; ++i) {         // joint to 1.1, at 12 rad/s
    rig.samples[0] = {-4 * 0.06 * i / kTwoPi, -4 * 12 / kTwoPi};
    rig.Run(5);
  }
  rig.samples[0].velocity = 0;
  rig.Run(20);
  CHECK(rig.states.back().position[0] == Approx(1.1));
  CHECK(rig.drives[0].Torque() == 0);
  rig.effort = -9;
  rig.Run(20);
  CHECK(rig.drives[0].Torque() == 0.5);
  rig.samples[0] = {0, 4 * 21 / kTwoPi};  // joint at -21 rad/s: too fast
  rig.Run(20);
  CHECK(rig.drives[0].Torque() == 0);
}

TEST_CASE("silence takes the torque away, then disarms") {
  Rig rig;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(50);
  REQUIRE(rig.drives[0].Torque() == 1);
  rig.commanding = false;
  int64_t to_zero = 0;
  while (rig.drives[0].Torque() != 0 && to_zero < 1000) rig.Step(), ++to_zero;
  CHECK(to_zero > 95);
  CHECK(to_zero <= 105);
  CHECK(rig.driver->state() == DriveState::kArmed);
  CHECK(rig.Status().commands_expired == 1);
  const int64_t to_fault = to_zero + rig.RunUntil(DriveState::kFault);
  CHECK(to_fault >= 250);
  CHECK(to_fault <= 260);
  CHECK_THAT(rig.Reason(), StartsWith("no command for 25"));
  rig.Run(100);
  CHECK_FALSE(rig.drives[0].armed());
  CHECK(rig.drives[0].disarm_reason() == 0);  // we disarmed it, not its watchdog
  CHECK(rig.driver->confirmed_idle());
}

TEST_CASE("a controller that never begins is silence, too") {
  Rig rig;
  rig.Start();
  rig.Run(300);
  rig.Request(driver_request_t::ARM);
  REQUIRE(rig.RunUntil(DriveState::kArmed) >= 0);
  const int64_t waited = rig.RunUntil(DriveState::kFault);
  CHECK(waited >= 245);
  CHECK(waited <= 260);
  CHECK_THAT(rig.Reason(), StartsWith("no command for"));
}

TEST_CASE("it does not arm by itself, nor again") {
  Rig rig;
  rig.Start();
  rig.commanding = false;
  rig.Run(1000);
  CHECK(rig.driver->state() == DriveState::kIdle);
  rig.Run(1);
  REQUIRE(rig.Arm());
  rig.commanding = false;
  REQUIRE(rig.RunUntil(DriveState::kFault) >= 0);
  const int64_t fault = rig.now;
  rig.commanding = true;
  rig.Run(1000);
  CHECK(rig.driver->state() == DriveState::kFault);
  CHECK_FALSE(rig.drives[0].armed());
  rig.commanding = false;
  // A wish from before the fault is not a wish to go on.
  rig.Request(driver_request_t::ARM, rig.now - fault + 1000);
  rig.Run(10);
  CHECK(rig.driver->state() == DriveState::kFault);
  rig.Request(driver_request_t::ARM);
  rig.commanding = true;
  CHECK(rig.RunUntil(DriveState::kArmed) >= 0);
}

TEST_CASE("an ARM whose maker's clock is ahead counts once") {
  Rig rig;
  rig.Start();
  rig.Run(400);
  driver_request_t arm{};
  arm.utime = rig.utime() + 1'000'000;
  arm.request = driver_request_t::ARM;
  rig.driver->OnRequest(arm, rig.now, rig.utime());
  REQUIRE(rig.RunUntil(DriveState::kArmed) >= 0);
  REQUIRE(rig.RunUntil(DriveState::kFault) >= 0);
  rig.driver->OnRequest(arm, rig.now, rig.utime());
  rig.Run(10);
  CHECK(rig.driver->state() == DriveState::kFault);
  CHECK_THAT(rig.Reason(), StartsWith("no command for") &&
                               Contains("; ARM refused: it, or a newer one, was obeyed"));
}

TEST_CASE("an ARM from the far future is refused and does no harm") {
  Rig rig;
  rig.Start();
  rig.Run(400);
  for (const int64_t ahead : {int64_t{1'000'001}, std::numeric_limits<int64_t>::max() / 2}) {
    rig.Request(driver_request_t::ARM, -ahead);
    rig.Run(10);
    CHECK(rig.driver->state() == DriveState::kIdle);
    CHECK_THAT(rig.Reason(), Contains("dated in the future"));
  }
  CHECK_THAT(rig.Reason(), StartsWith("ARM refused (2 times): "));
  CHECK(rig.Arm());
  rig.Request(driver_request_t::DISARM);
  rig.Run(200);
  rig.Request(driver_request_t::ARM, 300'000);
  CHECK_THAT(rig.Reason(),
             Equals("disarmed on request; ARM refused: it was made before the driver stopped"));
}

TEST_CASE("an ARM from before the driver's start is not for it") {
  Rig rig;
  rig.Start();
  rig.Run(400);
  rig.Request(driver_request_t::ARM, 400'001);
  rig.Run(10);
  CHECK(rig.driver->state() == DriveState::kIdle);
  CHECK(rig.Reason() == "ARM refused: it was made before the driver started");
}

TEST_CASE("the start guard") {
  Rig rig;
  rig.Start();
  rig.Run(100);
  rig.Request(driver_request_t::ARM);
  rig.Run(10);
  CHECK(rig.driver->state() == DriveState::kIdle);
  CHECK_THAT(rig.Reason(), Contains("only just started"));

  // A controller of an earlier run is still talking.
  rig.commanding = true;
  rig.effort = 1;
  rig.Run(300);
  rig.Request(driver_request_t::ARM);
  rig.Run(100);
  CHECK(rig.driver->state() == DriveState::kIdle);
  CHECK_THAT(rig.Reason(), Contains("stop the controller of an earlier run"));
  CHECK(rig.Status().commands_accepted == 0);
  CHECK(rig.Status().commands_rejected > 0);
  CHECK(rig.drives[0].setpoints() == 0);

  rig.commanding = false;
  rig.Run(260);
  CHECK(rig.Arm());
}

TEST_CASE("ARM is refused while something is missing, and says what") {
  Rig rig(2);
  bool heartbeat = false, encoder = false;
  rig.to_driver = [&](Frame& frame) {
    return (frame.id != 0x41 || heartbeat) && (frame.id != 0x49 || encoder);  // node 2
  };
  rig.Start();
  rig.Run(300);
  CHECK(rig.driver->state() == DriveState::kAbsent);
  CHECK_THAT(rig.Status().reason, Equals("knee1: no heartbeat yet"));
  rig.Request(driver_request_t::ARM);
  CHECK_THAT(rig.Reason(), Equals("ARM refused: knee1: no heartbeat yet"));
  heartbeat = true;
  rig.Run(30);
  rig.Request(driver_request_t::ARM);
  CHECK_THAT(rig.Reason(), Equals("ARM refused (2 times): knee1: no encoder estimates"));
  encoder = true;
  rig.driver->OnLink(0, LinkState::kDown);
  rig.Run(10);
  rig.Request(driver_request_t::ARM);
  CHECK_THAT(rig.Reason(), Contains("interface is not up"));
  rig.driver->OnLink(0, LinkState::kUp);
  CHECK(rig.Arm());
  CHECK(rig.drives[1].armed());
}

TEST_CASE("a lost version request is asked again") {
  Rig rig;
  int asked = 0;
  rig.to_drive = [&](Frame& frame) { return frame.id != 0x20 || ++asked > 3; };
  rig.Start();
  CHECK(rig.Arm());
}

TEST_CASE("stops on request") {
  Rig rig;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(20);
  SECTION("DISARM") {
    rig.Request(driver_request_t::DISARM, 3'600'000'000);  // however old
    rig.Run(5);
    CHECK(rig.drives[0].Torque() == 0);
    CHECK(rig.driver->state() == DriveState::kIdle);
    CHECK(rig.Reason() == "disarmed on request");
    rig.Run(30);
    CHECK(rig.driver->confirmed_idle());
    CHECK(rig.drives[0].disarm_reason() == 0);
    CHECK(rig.Status().stopped_by_request);
  }
  SECTION("the process ends, which nobody has requested") {
    rig.driver->End("the bus is gone", rig.now, rig.utime());
    rig.Run(5);
    CHECK(rig.drives[0].Torque() == 0);
    CHECK(rig.driver->state() == DriveState::kIdle);
    CHECK(rig.Reason() == "the driver ends: the bus is gone");
    CHECK_FALSE(rig.Status().stopped_by_request);
    rig.Request(driver_request_t::ARM);  // as whoever keeps it armed would
    rig.Run(30);
    CHECK(rig.driver->confirmed_idle());
    CHECK(rig.Reason() == "the driver ends: the bus is gone; ARM refused: the driver ends");
  }
  SECTION("the process ends after somebody has stopped the motors") {
    rig.Request(driver_request_t::DISARM);
    rig.Run(5);
    rig.driver->End("the bus is gone", rig.now, rig.utime());
    rig.Run(5);
    CHECK(rig.Reason() == "disarmed on request");
    CHECK(rig.Status().stopped_by_request);
  }
  SECTION("the process ends after a fault") {
    rig.driver->OnLink(0, LinkState::kDown);
    rig.Run(5);
    REQUIRE(rig.driver->state() == DriveState::kFault);
    const std::string fault = rig.Reason();
    rig.driver->End("it was told to", rig.now, rig.utime());
    rig.Run(5);
    CHECK(rig.Reason() == fault);
  }
  SECTION("ESTOP") {
    rig.Request(driver_request_t::ESTOP);
    rig.Run(5);
    CHECK(rig.drives[0].Torque() == 0);
    CHECK(rig.driver->state() == DriveState::kFault);
    CHECK(rig.Reason() == "emergency stop requested");
    CHECK(rig.drives[0].disarm_reason() == cansimple::kEstopRequested);
    rig.Run(1000);
    CHECK(rig.driver->state() == DriveState::kFault);
    CHECK(rig.Arm());  // ARM clears it
  }
}

}  // namespace
}  // namespace plumb
