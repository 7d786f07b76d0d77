// The whole robot on its bus: a driver and a virtual hopper in virtual time.

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <map>
#include <vector>

#include "tests/sim/robots.h"
#include "tests/sim/virtual/hopper_bus.h"

namespace plumb {
namespace {

using Eigen::VectorXd;

constexpr int64_t kHopperStart = HopperBus::kStart;

RobotDescription Hopper(const std::string& file) {
  return LoadRobot(SourceFile("robots/hopper/" + file));
}

void Wiggle(HopperBus& bus) {
  bus.effort = [&bus] {
    const double phase = 1e-5 * static_cast<double>(bus.now());
    return Eigen::Vector3d(30 * std::sin(phase + 3), 30 * std::sin(phase + 4),
                           30 * std::sin(phase + 5));
  };
}

TEST_CASE("a hopper on one bus: every joint is measured as it is, whatever measures it") {
  const std::string file = GENERATE("robot.toml", "mit.toml");
  INFO(file);
  HopperBus bus(Hopper(file));
  REQUIRE(bus.Place(1));
  const bool armed = bus.Arm();
  INFO(bus.driver.reason());
  REQUIRE(armed);
  REQUIRE(bus.Place(2));  // nobody pulls: a hand may be as fast as it likes
  bus.Run(100);
  bus.states.clear(), bus.truth_q.clear(), bus.truth_v.clear(), bus.imus.clear(), bus.count.clear();
  Wiggle(bus);
  bus.Run(1000);
  INFO(bus.driver.reason());
  REQUIRE(bus.driver.state() == DriveState::kArmed);

  // Each of the devices at its rate.
  REQUIRE(bus.states.size() == 500);
  CHECK(bus.imus.size() == 200);
  CHECK(bus.count[0x181] == 500);
  CHECK(bus.count[0x182] == 500);
  CHECK(bus.count[0x385] == 200);
  if (file == "robot.toml") {
    for (const uint32_t torque : {0x2Eu, 0x4Eu, 0x6Eu}) CHECK(bus.count[torque] == 500);
    for (const uint32_t estimates : {0x29u, 0x49u, 0x69u}) CHECK(bus.count[estimates] == 500);
  } else {
    for (const uint32_t command : {0x1u, 0x2u, 0x3u}) CHECK(bus.count[command] == 500);
  }
  // The measurements show the motion.
  VectorXd moved = VectorXd::Zero(6);
  for (size_t k = 1; k < bus.states.size(); ++k) {
    const joint_state_t& state = bus.states[k];
    for (size_t i = 0; i < 6; ++i) {
      REQUIRE(state.valid[i]);
      CHECK(state.utime - state.measured[i] >= -1'000);
      CHECK(state.utime - state.measured[i] <= 5'100);
      const auto index = static_cast<Eigen::Index>(i);
      const double age = 1e-6 * static_cast<double>(state.utime - state.measured[i]);
      // Resolutions, and what a joint moves within its reading's age and the tenth of a millisecond
      // of our steps.
      const double resolution = i < 2    ? 1.5 * 6.3 / 65536
                                : i == 2 ? 1e-4
                                         : 25. / 32768 + 6.3 / 16384;
      CHECK(std::abs(state.position[i] - bus.truth_q[k][index]) <
            resolution + (age + 2.5e-3) * (std::abs(bus.truth_v[k][index]) + 0.5));
      moved[index] =
          std::max(moved[index], std::abs(bus.truth_q[k][index] - bus.truth_q[0][index]));
    }
    CHECK(state.velocity[2] == Approx(bus.truth_v[k][2]).margin(2.0));
    CHECK(std::isnan(state.effort_measured[0]));
    CHECK(state.effort_sent[0] == 0);
  }
  CHECK(moved.minCoeff() > 0.01);
}

TEST_CASE("without a boom the driver leaves the base's slides to the estimator, and says so") {
  HopperBus bus(Hopper("free.toml"));
  REQUIRE(bus.Place(1));
  REQUIRE(bus.Arm());
  bus.Run(100);
  const joint_state_t& state = bus.states.back();
  for (size_t i = 0; i < 6; ++i) {
    CHECK(state.valid[i] == (i >= 2));
    CHECK(std::isfinite(state.position[i]) == (i >= 2));
  }
  const driver_status_t& status = bus.driver.Status(kHopperStart, {}, 0);
  CHECK(status.joint_state[0] == driver_status_t::IDLE);
  CHECK_THAT(status.joint_reason[1], Catch::Contains("estimator"));
}

TEST_CASE("an IMU at rest feels gravity upwards, in its link's axes") {
  HopperBus bus(Hopper("robot.toml"));
  VectorXd q = VectorXd::Zero(6), v = VectorXd::Zero(6);
  q[1] = 1e3;  // far above the ground
  q[2] = 0.5;
  v[0] = 3;
  REQUIRE(bus.robot.Place(1, q, v));
  bus.Run(1000);
  REQUIRE(bus.imus.size() > 100);
  // In free fall it feels nothing; it does not turn, since the leg hangs straight.
  const imu_t& falling = bus.imus.back();
  CHECK(Eigen::Map<const Eigen::Vector3d>(falling.force).norm() < 0.5);
  CHECK(falling.orientation[2] == Approx(std::sin(0.25)).margin(0.1));
  CHECK(falling.name == "imu");
  CHECK(falling.link == "torso");
}

TEST_CASE("a sensor that goes silent stops the robot") {
  HopperBus bus(Hopper("robot.toml"));
  REQUIRE(bus.Place(1));
  REQUIRE(bus.Arm());
  bus.Run(100);
  // An emergency message of the boom's first encoder: hardware error.
  const Frame emergency = *FrameFromText("081#0050010000000000");
  bus.driver.OnFrame(0, emergency, bus.now(), kHopperStart + bus.now());
  Wiggle(bus);
  bus.Run(10);
  CHECK(bus.driver.state() == DriveState::kFault);
  CHECK_THAT(std::string(bus.driver.reason()),
             Catch::Contains("boom_yaw: it reports error 0x5000"));
  bus.Run(100);
  CHECK_FALSE(bus.robot.devices()[0]->armed());
  // Arming again is a person's word that it is right again: the sensor begins anew.
  CHECK(bus.Arm() == false);
  CHECK(bus.Arm());
}

TEST_CASE("a joint that nothing measures is refused by its name") {
  RobotDescription description = Hopper("robot.toml");
  std::erase_if(description.sensors,
                [](const SensorDescription& sensor) { return sensor.name == "imu"; });
  CHECK_THROWS_WITH(Driver(description, 0, kHopperStart),
                    Catch::Contains("'rooty' has no motor, and no sensor measures it"));
}

}  // namespace
}  // namespace plumb
