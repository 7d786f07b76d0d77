// Reports of drives and encoders that cannot be true, or must not be: each stops the robot, with
// the reason.

#include <catch2/catch.hpp>
#include <numbers>

#include "drivers/protocols/cia406_device.h"
#include "tests/drivers/driver/rig.h"

namespace plumb {
namespace {

using Catch::Matchers::Contains;
using Catch::Matchers::StartsWith;

constexpr double kTurn = 2 * std::numbers::pi;

/// It stops the robot within so many ms, with the reason, without a torque from the same cycle on,
/// and for good.
void CheckStops(Rig& rig, int64_t within, const std::string& reason) {
  REQUIRE(rig.drives[0].Torque() != 0);
  const int64_t took = rig.RunUntil(DriveState::kFault, within);
  CHECK(took >= 0);
  CHECK_THAT(rig.Reason(), StartsWith(reason));
  for (const CanSimpleDevice& drive : rig.drives) CHECK(drive.Torque() == 0);
  rig.Run(300);
  CHECK(rig.driver->state() == DriveState::kFault);
  CHECK_THAT(rig.Reason(), StartsWith(reason));
  for (const CanSimpleDevice& drive : rig.drives) CHECK_FALSE(drive.armed());
}

TEST_CASE("an encoder that cannot be right stops the robot") {
  Rig rig(2);
  rig.robot.driver.stuck_after = 0.5;
  double velocity = 3;  // [rad/s] of the pivot
  bool turning = true;
  int8_t arm = driver_request_t::ARM;
  rig.on_step = [&] {
    if (turning) rig.samples[0].position += velocity / kTurn * 1e-3;
    rig.samples[0].velocity = velocity / kTurn;
    rig.samples[1].velocity = 0.01 * std::sin(static_cast<double>(rig.now));  // noise
  };
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(1000);
  REQUIRE(rig.driver->state() == DriveState::kArmed);
  SECTION("jump") {
    arm = driver_request_t::ARM_HOMED;
    rig.samples[0].position += 1 / kTurn;
    CheckStops(rig, 5, "pivot: the position jumped by 1.0");
  }
  SECTION("jump of the other joint") {
    arm = driver_request_t::ARM_HOMED;
    rig.samples[1].position -= 1 / kTurn;
    CheckStops(rig, 5, "knee1: the position jumped by -1 in 5 ms, at a velocity limit of 20");
  }
  SECTION("position that stays while the velocity does not") {
    turning = false;
    CheckStops(rig, 600, "pivot: position and velocity disagree: it moved by");
  }
  SECTION("stuck") {
    velocity = 0;
    rig.Run(200);
    CHECK(rig.driver->state() == DriveState::kArmed);
    CheckStops(rig, 500, "pivot: encoder stuck, or the joint is blocked");
  }
  SECTION("second drive of the same id") {
    CanSimpleDevice second({.node = 2, .heartbeat_period = 20'000, .encoder_period = 5'000},
                           rig.now);
    const auto step = rig.on_step;
    rig.on_step = [&] {
      step();
      FrameBatch batch;
      second.Tick(rig.now, rig.samples[1], batch);
      for (const Frame& frame : batch.frames()) {
        if (frame.id == 0x49) rig.driver->OnFrame(0, frame, rig.now, rig.utime());
      }
    };
    CheckStops(rig, 1000, "knee1: 151 encoder estimates in 37");
    rig.Request(driver_request_t::ARM);
    CHECK_THAT(rig.Reason(),
               Contains("ARM refused: knee1: more encoder estimates than one drive is to send"));
    rig.on_step = step;
    rig.Run(1000);
  }
  // The cause is gone.
  velocity = 3;
  turning = true;
  rig.Run(100);
  CHECK(rig.Arm(1) == (arm == driver_request_t::ARM));
  REQUIRE(rig.Arm(1, arm));
  rig.Run(400);
  CHECK(rig.driver->state() == DriveState::kArmed);
  CHECK(rig.drives[0].Torque() == 1);
}

TEST_CASE("only a virtual robot without an effort may jump") {
  Rig rig;
  rig.Start();
  SECTION("a real one may not") {
    REQUIRE(rig.Arm(0));
    rig.samples[0].position = 0.5;
    CHECK(rig.RunUntil(DriveState::kFault, 10) >= 0);
  }
  SECTION("a virtual one may") {
    rig.driver->set_virtual(true);
    REQUIRE(rig.Arm(0));
    rig.samples[0].position = 0.5;
    rig.Run(200);
    CHECK(rig.driver->state() == DriveState::kArmed);
    rig.effort = 1;
    rig.Run(200);
    CHECK(rig.driver->state() == DriveState::kArmed);
    rig.samples[0].position = 0;
    CheckStops(rig, 5, "pivot: the position jumped");
  }
  SECTION("but not in the middle of an episode, whatever its effort") {
    rig.driver->set_virtual(true);
    REQUIRE(rig.Arm(0));
    rig.episode = 1;
    rig.Run(200);
    CHECK(rig.driver->state() == DriveState::kArmed);
    rig.samples[0].position = 0.5;
    CHECK(rig.RunUntil(DriveState::kFault, 10) >= 0);
    CHECK_THAT(rig.Reason(), Contains("pivot: the position jumped"));
  }
}

TEST_CASE("heat and a bad supply stop the robot and keep it from being armed") {
  Rig rig;
  rig.robot.driver.min_bus_voltage = 20;
  rig.robot.driver.max_bus_voltage = 28;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(500);
  std::string why;
  SECTION("heat") {
    rig.drives[0].set_temperature(89);
    rig.Run(500);
    CHECK(rig.driver->state() == DriveState::kArmed);
    rig.drives[0].set_temperature(95.5);
    why = "pivot: the motor has 95.5 degC, more than max_motor_temperature = 90";
  }
  SECTION("under-voltage") {
    rig.drives[0].set_bus_voltage(18);
    why = "pivot: its supply has 18.0 V, less than min_bus_voltage = 20";
  }
  SECTION("over-voltage") {
    rig.drives[0].set_bus_voltage(30);
    why = "pivot: its supply has 30.0 V, more than max_bus_voltage = 28";
  }
  CheckStops(rig, 250, why);
  rig.Request(driver_request_t::ARM);
  CHECK(rig.driver->state() == DriveState::kFault);
  CHECK_THAT(rig.Reason(), Contains("ARM refused: " + why));
  rig.drives[0].set_temperature(40);
  rig.drives[0].set_bus_voltage(24);
  rig.Run(300);
  CHECK(rig.Arm(1));
}

TEST_CASE("a drive that stops to report temperatures is warned of, no more") {
  Rig rig;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(500);
  CHECK(rig.Status().joint_reason[0] == "");
  rig.to_driver = [](Frame& frame) { return frame.id != 0x35; };  // Get_Temperature
  rig.Run(900);
  CHECK(rig.Status().joint_reason[0] == "");
  const uint64_t revision = rig.driver->revision();
  rig.Run(300);
  CHECK_THAT(rig.Status().joint_reason[0], StartsWith("no temperatures for 1"));
  CHECK(rig.driver->revision() == revision + 1);
  CHECK(rig.driver->state() == DriveState::kArmed);
  CHECK(rig.drives[0].Torque() == 1);
  rig.to_driver = nullptr;
  rig.Run(300);
  CHECK(rig.Status().joint_reason[0] == "");
}

// A joint that turns steadily, with a second encoder of its output.
struct TwoEncoders : Rig {
  // velocity [rad/s]; period of the second encoder's readings [s]
  TwoEncoders(double velocity, double period)
      : encoder({.node = 5, .event_timer = static_cast<int64_t>(period * 1e6)}, now) {
    SensorDescription sensor{.name = "output", .protocol = "cia406", .period = period};
    sensor.joint = 0;
    sensor.node = 5;
    sensor.counts = sensor.range = 65536;
    sensor.max_speed =
        0.25 / period;  // [rad/s], far from half a turn, also where a reading is lost
    sensor.tolerance = 0.1;
    robot.sensors.push_back(sensor);
    on_step = [this, velocity] {
      samples[0].velocity = velocity / kTurn;
      samples[0].position += 1e-3 * velocity / kTurn;
      FrameBatch batch;
      encoder.Tick(now, samples[0].position * kTurn + slip, batch);
      for (const Frame& frame : batch.frames()) {
        if (!lost) driver->OnFrame(0, frame, now, utime());
      }
    };
    to_drive = [this](Frame& frame) {
      encoder.OnFrame(frame, now);
      return true;
    };
    samples.resize(1);  // from its first step on
    Start();
    Run(2000);
  }

  Cia406Device encoder;
  double slip = 0;    // of the output against its motor [rad]
  bool lost = false;  // whether the second encoder's frames are
};

TEST_CASE("two encoders of one joint must agree") {
  TwoEncoders rig(0.5, 0.005);
  REQUIRE(rig.Arm(1));
  rig.slip = 0.09;
  rig.Run(300);
  REQUIRE(rig.driver->state() == DriveState::kArmed);
  rig.slip = 0.2;
  CheckStops(rig, 10, "pivot: output measures ");
  CHECK_THAT(rig.Reason(), Contains(", which differ by more than 0.125"));
  rig.Request(driver_request_t::ARM);
  CHECK_THAT(rig.Reason(), Contains("ARM refused: pivot: output measures "));
  rig.slip = 0;
  rig.Run(50);
  CHECK(rig.Arm(1));
}

TEST_CASE("a slow second encoder may lose a reading while its joint turns") {
  TwoEncoders rig(4, 0.05);
  REQUIRE(rig.Arm(1));
  rig.lost = true;
  rig.Run(50);
  rig.lost = false;
  rig.Run(100);
  CHECK(rig.driver->state() == DriveState::kArmed);
  CHECK(rig.Reason() == "");
}

}  // namespace
}  // namespace plumb
