// A pendulum on a moteus, over CAN FD: real processes, and a witness of what the motor is told and
// says.

#include <cmath>

#include "drivers/protocols/moteus.h"
#include "plumb/joint_state_t.hpp"
#include "tests/process/stage.h"

namespace plumb {
namespace {

using namespace moteus;
using Catch::Contains;

struct Witness {
  explicit Witness(Stage& watched) : stage(watched) {
    stage.on_frame = [this](const Frame& frame) { OnFrame(frame); };
  }
  void OnFrame(const Frame& frame) {
    if (frame.id == CommandId(1)) {
      CHECK((frame.fd && frame.bit_rate_switch && frame.extended));
      ++frames_to;
      if (HasShape(kCommand, frame)) {
        told = frame.receive_ns / 1000;
        asked = (*DecodePayload(kCommand.layout, frame))[3];
      }
    }
    if (frame.id != AnswerId(1) || !HasShape(kAnswer, frame)) return;
    CHECK((frame.fd && frame.bit_rate_switch && !frame.extended));
    ++answers;
    const FieldValues values = *DecodePayload(kAnswer.layout, frame);
    mode = static_cast<int>(values[0]);
    given = values[3];
  }

  Stage& stage;
  double asked = 0, given = 0;  ///< [Nm]
  int64_t told = 0;             ///< time of the last command
  int mode = -1;                ///< of the last answer
  int frames_to = 0, answers = 0;
};

/// Up to an episode with a torque.
void Run(Stage& stage, const Witness& witness) {
  stage.StartAll();
  REQUIRE(stage.WaitUntil([&] { return stage.controllers.received() > 0; }, 20));
  REQUIRE(stage.Arm(20));
  stage.PublishPolicy();
  REQUIRE(stage.WaitUntil([&] { return std::abs(witness.given) > 0.1; }, 20));
}

TEST_CASE("a pendulum on a moteus: a command and an answer in every cycle") {
  Stage stage(120, "pendulum/moteus.toml");
  Witness witness(stage);
  Subscriber<joint_state_t> joints(stage.messenger, "JOINT_STATE");
  Run(stage, witness);
  witness.frames_to = witness.answers = 0;
  const int64_t before = joints.received();
  stage.Listen(2);
  INFO(stage.drivers.newest().reason);
  CHECK(stage.drivers.newest().state == driver_status_t::ARMED);
  CHECK(witness.mode == kPositionMode);
  CHECK(std::abs(joints.received() - before - 400) <= 1);
  CHECK(std::abs(witness.frames_to - 400) <= 1);
  CHECK(std::abs(witness.answers - 400) <= 1);
  CHECK(std::abs(witness.asked) <= 2 + 1e-6);
  const driver_status_t& status = stage.drivers.newest();
  CHECK(status.bus_voltage[0] == 24);
  CHECK_THAT(status.drive_identity[0], Contains("moteus, firmware"));
  CHECK(status.drive_temperature[0] == 25);
  CHECK(status.buses[0].frames_rejected == 0);
  CHECK(joints.newest().effort_measured[0] == Approx(witness.given).margin(1e-6));

  stage.Request(driver_request_t::DISARM);
  CHECK(stage.WaitUntil([&] { return witness.mode == kStopped; }, 1));
  CHECK(stage.WaitForDriver(driver_status_t::IDLE, 1));
  stage.Listen(1);
  CHECK(witness.mode == kStopped);
}

TEST_CASE("no torque of a moteus outlives the driver, and none comes back with it") {
  Stage stage(121, "pendulum/moteus.toml");
  Witness witness(stage);
  Run(stage, witness);
  SECTION("the driver is killed") {
    stage.Kill("plumb-driver");
    stage.Listen(0.3);
    witness.mode = -1;
    stage.StartDriver();
    // The first that it says to a driver that has come back, before "stop" has led out of it.
    REQUIRE(stage.WaitUntil([&] { return witness.mode >= 0; }, 5));
    CHECK((witness.mode == kTimedOut || witness.mode == kStopped));
  }
  SECTION("the driver stands still") {
    stage.Stall("plumb-driver", 0.5);
    CHECK(stage.WaitForDriver(driver_status_t::FAULT, 1));
    CHECK_THAT(stage.drivers.newest().reason, Contains("pivot"));
  }
  stage.Listen(1);
  CHECK(witness.given == 0);
  CHECK(witness.mode == kStopped);
  CHECK(stage.drivers.newest().state != driver_status_t::ARMED);
  // A person may arm it again.
  CHECK(stage.Arm(20));
}

}  // namespace
}  // namespace plumb
