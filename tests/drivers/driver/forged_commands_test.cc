// Commands and ARM requests whose signature is wrong: they are counted and said, and do nothing
// else.

#include <catch2/catch.hpp>

#include "tests/drivers/driver/rig.h"

namespace plumb {
namespace {

constexpr char kWhy[] = "not signed with the driver's key";

TEST_CASE("nothing but forged commands disarm as silence does, and the reason says what they are") {
  Rig rig;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(50);
  REQUIRE(rig.drives[0].Torque() == 1);
  rig.commanding = false;
  rig.on_step = [&] { rig.driver->OnForgedCommand(kWhy); };
  rig.Run(110);  // expiry and a cycle
  CHECK(rig.driver->state() == DriveState::kArmed);
  CHECK(rig.drives[0].Torque() == 0);
  CHECK(rig.RunUntil(DriveState::kFault) <= 260 - 110);
  CHECK_THAT(
      rig.Reason(),
      Catch::StartsWith("commands refused: not signed with the driver's key (none taken for 25"));
  CHECK(rig.Status().commands_forged >= 110);
}

TEST_CASE(
    "forged commands beside genuine ones change nothing, and are not blamed for a later silence") {
  Rig rig;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.on_step = [&] { rig.driver->OnForgedCommand(kWhy); };
  const int64_t accepted = rig.Status().commands_accepted;
  rig.Run(1000);
  CHECK(rig.driver->state() == DriveState::kArmed);
  CHECK(rig.drives[0].Torque() == 1);
  CHECK(rig.Status().commands_forged == 1000);
  CHECK(rig.Status().commands_accepted == accepted + 200);
  CHECK(rig.Status().commands_rejected == 0);
  rig.on_step = {};
  rig.Run(10);
  rig.commanding = false;
  REQUIRE(rig.RunUntil(DriveState::kFault) > 0);
  CHECK_THAT(rig.Reason(), Catch::StartsWith("no command for 25"));
}

TEST_CASE("a forged ARM arms nothing, and says why") {
  Rig rig;
  rig.Start();
  rig.Run(300);
  rig.driver->OnForgedArm(kWhy);
  rig.Run(100);
  CHECK(rig.driver->state() == DriveState::kIdle);
  CHECK(rig.Reason() == "ARM refused: not signed with the driver's key");
  CHECK(rig.Status().commands_forged == 1);
  // Beside an armed robot it is only counted; nor does it lead out of a fault, whose cause stays in
  // sight.
  REQUIRE(rig.Arm());
  rig.driver->OnForgedArm(kWhy);
  CHECK(rig.Reason().empty());
  rig.Request(driver_request_t::ESTOP);
  rig.driver->OnForgedArm(kWhy);
  rig.Run(100);
  CHECK(rig.driver->state() == DriveState::kFault);
  CHECK_THAT(rig.Reason(),
             Catch::StartsWith("emergency stop requested; ARM refused") && Catch::EndsWith(kWhy));
  CHECK(rig.Status().commands_forged == 3);
}

TEST_CASE("forged commands after the start do not keep the robot from being armed") {
  Rig rig;
  rig.Start();
  rig.on_step = [&] { rig.driver->OnForgedCommand(kWhy); };
  CHECK(rig.Arm(1));
  rig.Run(50);
  CHECK(rig.drives[0].Torque() == 1);
}

TEST_CASE(
    "a request is answered by its identity, whether it is obeyed or refused; a forged one is not") {
  Rig rig;
  rig.Start();
  const auto ask = [&](int8_t what, int64_t identity) {
    driver_request_t request{};
    request.utime = rig.utime();
    request.request = what;
    request.identity = identity;
    rig.driver->OnRequest(request, rig.now, rig.utime());
  };
  CHECK(rig.Status().answered == 0);
  ask(driver_request_t::ARM, 11);  // too early
  CHECK(rig.Status().answered == 11);
  CHECK_THAT(rig.Reason(), Catch::Contains("ARM refused"));
  rig.Run(300);
  const uint64_t revision = rig.driver->revision();
  ask(driver_request_t::ARM, 12);
  CHECK(rig.driver->revision() != revision);  // it is said at once
  CHECK(rig.Status().answered == 12);
  ask(driver_request_t::DISARM, 13);
  CHECK(rig.Status().answered == 13);
  ask(driver_request_t::DISARM, 0);  // of somebody who does not want to know
  rig.driver->OnForgedArm(kWhy);
  CHECK(rig.Status().answered == 13);
  ask(driver_request_t::ESTOP, -5);
  CHECK(rig.Status().answered == -5);
  CHECK(rig.driver->state() == DriveState::kFault);
}

TEST_CASE("the status says whether commands must be signed") {
  Rig rig;
  rig.Start();
  CHECK_FALSE(rig.Status().commands_signed);
  rig.driver->set_commands_signed(true);
  CHECK(rig.Status().commands_signed);
}

}  // namespace
}  // namespace plumb
