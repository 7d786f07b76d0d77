// A pendulum on an RMD motor: real processes, and a witness of what the motor is told and says.

#include <cmath>

#include "drivers/protocols/rmd.h"
#include "plumb/joint_state_t.hpp"
#include "tests/process/stage.h"

namespace plumb {
namespace {

using Catch::Contains;

struct Witness {
  explicit Witness(Stage& watched) : stage(watched) {
    stage.on_frame = [this](const Frame& frame) { OnFrame(frame); };
  }
  void OnFrame(const Frame& frame) {
    const bool command = frame.id == rmd::kCommands + 1, answer = frame.id == rmd::kAnswers + 1;
    if (!command && !answer) return;
    CHECK(frame.length == 8);
    if (command) told = frame.receive_ns / 1000;
    switch (frame.data[0]) {
      case rmd::kTorqueControl:
        if (command) asked = (*DecodePayload(rmd::kTorque, frame))[1];
        if (answer) given = (*DecodePayload(rmd::kTorqueAnswer, frame))[2];
        break;
      case rmd::kInterrupted:
        if (interrupted == 0) interrupted = frame.receive_ns / 1000;
        given = 0;
        break;
      case rmd::kShutdown:
        if (answer) given = 0;
        stopped = answer;
        break;
      case rmd::kReleaseBrake:
        stopped = false;
        break;
      default:
        break;
    }
  }

  Stage& stage;
  double asked = 0, given = 0;        ///< [A]
  int64_t told = 0, interrupted = 0;  ///< times of the last command, of the first warning
  bool stopped = false;               ///< it said so last
};

/// Up to an episode with a torque.
void Run(Stage& stage, const Witness& witness) {
  stage.StartAll();
  REQUIRE(stage.WaitUntil([&] { return stage.controllers.received() > 0; }, 20));
  REQUIRE(stage.Arm(20));
  stage.PublishPolicy();
  REQUIRE(stage.WaitUntil([&] { return std::abs(witness.given) > 0.1; }, 20));
}

TEST_CASE("a pendulum on an RMD motor: two questions and two answers in every cycle") {
  Stage stage(26, "pendulum/rmd.toml");
  Witness witness(stage);
  Subscriber<joint_state_t> joints(stage.messenger, "JOINT_STATE");
  Run(stage, witness);
  stage.frames_by_id.clear();
  const int64_t before = joints.received();
  stage.Listen(2);
  INFO(stage.drivers.newest().reason);
  CHECK(stage.drivers.newest().state == driver_status_t::ARMED);
  CHECK(std::abs(joints.received() - before - 400) <= 1);
  // 400 setpoints, 400 questions for the angle, and 80 for the readings in turn.
  CHECK(std::abs(stage.frames_by_id[0x141] - 880) <= 3);
  CHECK(std::abs(stage.frames_by_id[0x241] - 880) <= 3);
  CHECK(std::abs(witness.asked) <= 2 / 0.9 + 0.005);
  const driver_status_t& status = stage.drivers.newest();
  CHECK(status.bus_voltage[0] == Approx(48));
  CHECK(status.drive_identity[0] == "X8S2V10, software of 20220206");
  CHECK(status.motor_temperature[0] == 25);
  CHECK(status.buses[0].frames_rejected == 0);
  CHECK(joints.newest().effort_measured[0] == Approx(0.9 * witness.given).margin(0.01));

  stage.Request(driver_request_t::DISARM);
  CHECK(stage.WaitUntil([&] { return witness.stopped; }, 1));
  CHECK(stage.WaitForDriver(driver_status_t::IDLE, 1));
  stage.Listen(1);
  CHECK(witness.stopped);
  CHECK(witness.interrupted == 0);
}

TEST_CASE("no torque of an RMD motor outlives the driver, and none comes back with it") {
  Stage stage(27, "pendulum/rmd.toml");
  Witness witness(stage);
  Run(stage, witness);
  SECTION("the driver is killed") {
    stage.Kill("plumb-driver");
    REQUIRE(stage.WaitUntil([&] { return witness.interrupted != 0; }, 1));
    CHECK(std::abs(witness.interrupted - witness.told - 100'000) <= 500);
    stage.StartDriver();
  }
  SECTION("the driver stands still") {
    stage.Stall("plumb-driver", 0.5);
    REQUIRE(stage.WaitUntil([&] { return witness.interrupted != 0; }, 1));
    CHECK(std::abs(witness.interrupted - witness.told - 100'000) <= 500);
    CHECK(stage.WaitForDriver(driver_status_t::FAULT, 1));
    CHECK_THAT(stage.drivers.newest().reason, Contains("pivot"));
  }
  stage.Listen(1);
  CHECK(witness.given == 0);
  CHECK(witness.stopped);
  CHECK(stage.drivers.newest().state != driver_status_t::ARMED);
  // A person may arm it again.
  CHECK(stage.Arm(20));
}

TEST_CASE("a robot on RMD motors that loses its power stops, and can be armed again") {
  Stage stage(28, "pendulum/rmd.toml");
  Witness witness(stage);
  Run(stage, witness);
  stage.Kill("plumb-robot");
  CHECK(stage.WaitForDriver(driver_status_t::FAULT, 1));
  stage.Start("plumb-robot", {"--bus", stage.bus_url, "--seed", "1"});
  CHECK(stage.WaitUntil([&] { return witness.stopped; }, 20));
  CHECK(stage.drivers.newest().state == driver_status_t::FAULT);
  CHECK(stage.Arm(20));
}

}  // namespace
}  // namespace plumb
