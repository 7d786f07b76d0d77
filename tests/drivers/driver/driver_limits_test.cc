// Limits, and how a stop feels, through the whole driver.

#include <catch2/catch.hpp>
#include <numbers>

#include "tests/drivers/driver/rig.h"

namespace plumb {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

TEST_CASE("efforts are limited, and the cycles are counted in which they were") {
  Rig rig;
  JointDescription& joint = rig.robot.joints[0];
  joint.type = JointDescription::Type::kRevolute;
  joint.lower = -1;
  joint.upper = 1;
  SECTION("margin") {
    joint.limits.position_margin = 0.5;
    rig.Start();
    rig.samples[0].position = 0.75 / kTurn;
    REQUIRE(rig.Arm(2));
    rig.Run(100);
    CHECK(rig.drives[0].Torque() == Approx(1));
    const int64_t limited = rig.Status().commands_limited;
    CHECK(limited >= 20);
    rig.effort = 0.9;
    rig.Run(100);
    CHECK(rig.drives[0].Torque() == Approx(0.9));
    CHECK(rig.Status().commands_limited == limited);
    rig.effort = -2;
    rig.Run(100);
    CHECK(rig.drives[0].Torque() == -2);
    CHECK(rig.Status().commands_limited == limited);
  }
  SECTION("rate") {
    joint.limits.effort_rate = 10;
    rig.Start();
    REQUIRE(rig.Arm());
    rig.effort = 1;
    std::vector<double> torques;
    for (int i = 0; i < 25; ++i) {
      rig.Run(5);
      torques.push_back(rig.drives[0].Torque());
    }
    CHECK(torques[0] == Approx(0.05));
    CHECK(torques[9] == Approx(0.5));
    CHECK(torques[24] == 1);
    CHECK(rig.Status().commands_limited == 19);
    // A torque that the bus did not take has not grown.
    rig.effort = 2;
    rig.bus_full = true;
    rig.Run(25);
    rig.bus_full = false;
    rig.Run(5);
    CHECK(rig.drives[0].Torque() == Approx(1.05));
    rig.effort = 0;
    rig.Run(5);
    CHECK(rig.drives[0].Torque() == 0);
  }
}

TEST_CASE("without a command") {
  Rig rig;
  rig.robot.joints[0].limits.damping = 0.5;
  const auto silence = [&](double effort) {  // until the last command expires
    rig.Start();
    REQUIRE(rig.Arm(effort));
    rig.Run(50);
    rig.commanding = false;
    rig.Run(100);
    CHECK(rig.drives[0].Torque() == effort);
    rig.Run(5);
  };
  SECTION("zero") {
    silence(1);
    CHECK(rig.drives[0].Torque() == 0);
  }
  SECTION("ramp") {
    rig.robot.driver.stop = DriverSettings::Stop::kRamp;
    rig.robot.driver.ramp = 0.1;
    silence(1);
    CHECK(rig.drives[0].Torque() == Approx(0.95));
    rig.Run(45);
    CHECK(rig.drives[0].Torque() == Approx(0.5));
    SECTION("to its end") {
      rig.Run(50);
      CHECK(rig.drives[0].Torque() == 0);
      CHECK(rig.driver->state() == DriveState::kArmed);
      CHECK(rig.RunUntil(DriveState::kFault, 55) >= 0);
      CHECK(rig.Reason() == "no command for 255 ms");
    }
    SECTION("to its end, whatever comes that has expired before it could be obeyed") {
      for (int i = 0; i < 12; ++i) {
        rig.Run(2);
        joint_command_t late = rig.MakeCommand(1);
        late.expiry = 1000;
        rig.driver->OnCommand(late, rig.now, rig.utime());
        rig.Run(3);
      }
      CHECK(rig.drives[0].Torque() == 0);
    }
    SECTION("from a newer command's expiry, though it was never obeyed") {
      rig.commanding = true;
      rig.Run(20);
      rig.commanding = false;
      rig.Run(2);
      joint_command_t late = rig.MakeCommand(1);
      late.expiry = 1000;
      rig.driver->OnCommand(late, rig.now, rig.utime());
      rig.Run(8);
      CHECK(rig.drives[0].Torque() < 1);
      rig.Run(100);
      CHECK(rig.drives[0].Torque() == 0);
    }
    SECTION("a command ends it") {
      rig.commanding = true;
      rig.Run(5);
      CHECK(rig.drives[0].Torque() == 1);
    }
    SECTION("a request and a fault end it at once") {
      SECTION("request") { rig.Request(driver_request_t::DISARM); }
      SECTION("fault") { rig.driver->OnLink(0, LinkState::kDown); }
      rig.Run(5);
      CHECK(rig.drives[0].Torque() == 0);
      CHECK_FALSE(rig.drives[0].armed());
    }
    SECTION("the next time it begins where that one began") {
      rig.Run(200);
      CHECK(rig.driver->state() == DriveState::kFault);
      REQUIRE(rig.Arm(0.5));
      rig.Run(20);
      rig.commanding = false;
      rig.Run(110);
      CHECK(rig.drives[0].Torque() < 0.5);
      CHECK(rig.drives[0].Torque() > 0.4);
    }
  }
  SECTION("damping") {
    rig.robot.driver.stop = DriverSettings::Stop::kDamping;
    double velocity = 2;  // [rad/s]
    rig.on_step = [&] {
      rig.samples[0].velocity = velocity / kTurn;
      rig.samples[0].position += velocity / kTurn * 1e-3;
    };
    silence(1);
    CHECK(rig.drives[0].Torque() == Approx(-1));
    velocity = -3;
    rig.Run(10);
    CHECK(rig.drives[0].Torque() == Approx(1.5));
    velocity = -10;
    rig.Run(10);
    CHECK(rig.drives[0].Torque() == 2);  // the effort limit
    CHECK(rig.RunUntil(DriveState::kFault, 200) >= 0);
    rig.Run(5);
    CHECK(rig.drives[0].Torque() == 0);
  }
}

TEST_CASE("a stop by damping without a command yet is no torque") {
  Rig rig;
  rig.robot.joints[0].limits.damping = 0.5;
  rig.robot.driver.stop = DriverSettings::Stop::kDamping;
  rig.on_step = [&] {
    rig.samples[0].velocity = 2 / kTurn;
    rig.samples[0].position += 2e-3 / kTurn;
  };
  rig.Start();
  rig.Run(300);
  rig.Request(driver_request_t::ARM);
  REQUIRE(rig.RunUntil(DriveState::kArmed) >= 0);
  rig.Run(20);
  CHECK(rig.drives[0].Torque() == 0);
}

}  // namespace
}  // namespace plumb
