#include "drivers/driver/joint_sensor.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <string>

#include "common/time_units.h"
#include "drivers/protocols/xsens_device.h"

namespace plumb {
namespace {

constexpr int64_t kStaleAfter = 100'000;

/// The hopper's IMU, which alone measures how its torso turns.
struct Torso {
  void Run(int milliseconds) {
    for (int i = 0; i < milliseconds; ++i) {
      now += 1000;
      FrameBatch frames;
      device.Tick(now, sample, frames);
      for (const Frame& frame : frames.frames()) sensor.OnFrame(frame, now, now);
    }
  }
  std::string Reason() const { return std::string(sensor.Silent(now).text()); }

  RobotDescription robot =
      LoadRobot(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/hopper");
  const SensorDescription& imu =
      *std::ranges::find_if(robot.sensors, [](const SensorDescription& s) { return s.link >= 0; });
  int64_t now = 1'000'000;
  JointSensor sensor{robot, imu, kStaleAfter};
  XsensDevice device{{.base = imu.base, .period = Microseconds(imu.period)}, now};
  XsensDevice::Sample sample;
};

TEST_CASE("an IMU that does not trust its orientation does not measure its joint") {
  Torso torso;
  torso.sample.status = 0;
  torso.Run(50);
  CHECK(torso.Reason().find("does not trust its orientation yet") != std::string::npos);
  torso.sample.status = xsens::kOrientationValid;
  torso.Run(50);
  CHECK(torso.sensor.fresh(torso.now));
  const double known = torso.sensor.newest().position;
  REQUIRE(std::isfinite(known));

  // It goes on sending, and turns; how far, nobody knows.
  torso.sample.status = 0;
  torso.sample.orientation = {std::cos(0.2), 0, std::sin(0.2), 0};
  torso.Run(90);
  CHECK(torso.sensor.fresh(torso.now));
  torso.Run(30);
  CHECK_FALSE(torso.sensor.fresh(torso.now));
  CHECK(torso.Reason().find("has not trusted its orientation for") != std::string::npos);
  CHECK(torso.sensor.newest().position == known);
  torso.sensor.At(torso.now);
  CHECK(torso.now - torso.sensor.measured() > kStaleAfter);

  torso.sample.status = xsens::kOrientationValid;
  torso.Run(20);
  CHECK(torso.sensor.fresh(torso.now));
  CHECK(std::abs(torso.sensor.newest().position - known) == Approx(0.4).margin(1e-3));
}

TEST_CASE("a rate beyond the IMU's range is none") {
  Torso torso;
  torso.Run(50);
  CHECK(std::isfinite(torso.sensor.newest().velocity));
  torso.sample.status |= xsens::kClippingDetected;
  torso.Run(20);
  CHECK(std::isfinite(torso.sensor.newest().position));
  CHECK(std::isnan(torso.sensor.newest().velocity));
}

}  // namespace
}  // namespace plumb
