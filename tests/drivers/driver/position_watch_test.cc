#include "drivers/driver/position_watch.h"

#include <catch2/catch.hpp>
#include <numbers>

#include "common/special_numbers.h"
#include "drivers/protocols/cia406_device.h"
#include "tests/drivers/driver/rig.h"

namespace plumb {
namespace {

using Catch::Matchers::Contains;
using Catch::Matchers::StartsWith;

void SetLimits(JointDescription& joint, double lower, double upper) {
  joint.type = JointDescription::Type::kRevolute;
  joint.lower = lower;
  joint.upper = upper;
}

TEST_CASE("a position is beyond the limits by a part of the range, until it is within them") {
  JointDescription joint;
  SetLimits(joint, -1, 3);
  PositionWatch watch(joint);
  const auto beyond = [&](double position) {
    watch.Look(position);
    CHECK(watch.Warning().text().empty() != watch.beyond());
    return watch.beyond();
  };
  CHECK_FALSE(beyond(kNaN));
  CHECK_FALSE(beyond(3.19));
  CHECK(beyond(3.21));
  CHECK(beyond(3.01));
  CHECK_FALSE(beyond(2.99));
  CHECK_FALSE(beyond(3.19));
  CHECK_FALSE(beyond(-1.19));
  CHECK(beyond(-1.21));
  CHECK(watch.Warning().text() ==
        "at -1.21 rad, beyond its limit of -1 rad in the URDF: is its zero, sign or gear ratio "
        "right?");
  CHECK_FALSE(beyond(0));
}

TEST_CASE("a joint that slides has limits in metres, one that goes round has none") {
  JointDescription joint;
  SetLimits(joint, 0, 0.5);
  joint.type = JointDescription::Type::kPrismatic;
  PositionWatch slide(joint);
  slide.Look(0.6);
  CHECK_THAT(std::string(slide.Warning().text()),
             StartsWith("at 0.6 m, beyond its limit of 0.5 m in the URDF"));

  PositionWatch wheel(Rig().robot.joints[0]);
  for (const double position : {-1e9, 1e9}) {
    wheel.Look(position);
    CHECK_FALSE(wheel.beyond());
  }
}

TEST_CASE("a joint beyond its limits is warned of, and can be armed and moved back") {
  Rig rig;
  SetLimits(rig.robot.joints[0], -1, 3);
  double position = 3.31, velocity = 0;
  rig.on_step = [&] {
    position += velocity * 1e-3;
    rig.samples[0] = {position / (2 * std::numbers::pi), velocity / (2 * std::numbers::pi)};
  };
  const auto says = [&] { return rig.Status().joint_reason[0]; };
  rig.Start();
  rig.Run(300);
  const std::string beyond = "at 3.31 rad, beyond its limit of 3 rad in the URDF";
  CHECK_THAT(says(), StartsWith(beyond));
  CHECK(rig.driver->state() == DriveState::kIdle);
  rig.Request(driver_request_t::ARM);
  CHECK_THAT(rig.Reason(), StartsWith("arming, although pivot is " + beyond));
  rig.commanding = true;
  rig.effort = 1;
  REQUIRE(rig.RunUntil(DriveState::kArmed) >= 0);
  CHECK(rig.Reason() == "");
  rig.Run(20);
  CHECK(rig.drives[0].Torque() == 0);  // not farther
  rig.effort = -1;
  rig.Run(20);
  CHECK(rig.drives[0].Torque() == -1);
  CHECK_THAT(says(), StartsWith(beyond));

  velocity = -5;
  rig.Run(50);
  CHECK_THAT(says(), StartsWith("at 3.0"));  // within the margin, but not yet within the limits
  const uint64_t revision = rig.driver->revision();
  rig.Run(30);
  CHECK(says() == "");
  CHECK(rig.driver->revision() == revision + 1);
  velocity = 5;
  rig.Run(40);
  CHECK(position > 3.1);
  CHECK(says() == "");
  CHECK(rig.driver->revision() == revision + 1);
  rig.Run(30);
  CHECK_THAT(says(), StartsWith("at 3.2"));
  CHECK(rig.driver->revision() == revision + 2);
  CHECK(rig.driver->state() == DriveState::kArmed);

  // What its drive has to say goes first.
  rig.Request(driver_request_t::ESTOP);
  CHECK(says() == "emergency stop requested");
}

TEST_CASE("a joint that only a sensor measures is warned of, too") {
  Rig rig(2);
  rig.robot.joints[1].passive = true;
  SetLimits(rig.robot.joints[1], -1, 1);
  SensorDescription sensor{.name = "encoder", .protocol = "cia406", .period = 0.005};
  sensor.joint = 1;
  sensor.node = 5;
  sensor.counts = sensor.range = 65536;
  sensor.max_speed = 50;
  rig.robot.sensors.push_back(sensor);
  Cia406Device encoder({.node = 5, .event_timer = 5'000}, rig.now);
  bool lost = false;
  rig.on_step = [&] {
    FrameBatch batch;
    encoder.Tick(rig.now, -1.2, batch);
    for (const Frame& frame : batch.frames()) {
      if (!lost) rig.driver->OnFrame(0, frame, rig.now, rig.utime());
    }
  };
  rig.to_drive = [&](Frame& frame) {
    encoder.OnFrame(frame, rig.now);
    return true;
  };
  rig.Start();
  rig.Run(2000);
  CHECK(rig.Status().joint_state[1] == driver_status_t::IDLE);
  CHECK_THAT(rig.Status().joint_reason[1],
             StartsWith("at -1.2 rad, beyond its limit of -1 rad in the URDF"));
  CHECK(rig.Status().joint_reason[0] == "");
  lost = true;
  rig.Run(500);
  CHECK_THAT(rig.Status().joint_reason[1], Contains("not heard any more"));
}

}  // namespace
}  // namespace plumb
