// What holds of every drive that speaks only when spoken to, whatever its protocol: each of them
// against its virtual motor, in virtual time.

#include "drivers/protocols/answering_motor.h"

#include <catch2/catch.hpp>
#include <string>

#include "drivers/protocols/registry.h"
#include "tests/drivers/protocols/mit_motor_bench.h"
#include "tests/drivers/protocols/moteus_motor_bench.h"
#include "tests/drivers/protocols/rmd_motor_bench.h"

namespace plumb {
namespace {

using Catch::StartsWith;

template <typename Bench>
std::string Reason(const Bench& bench) {
  return std::string(bench.motor->reason());
}

TEMPLATE_TEST_CASE("one that has never answered is absent, idle, and told to stop", "",
                   MitMotorBench, RmdMotorBench, MoteusMotorBench) {
  TestType bench;
  const auto fresh = MakeMotor(TestType::Describe(), {200'000});
  CHECK(fresh->state() == DriveState::kAbsent);
  CHECK(fresh->reason() == "no answer yet");
  CHECK(fresh->confirmed_idle());
  FrameBatch frames;
  fresh->Tick(bench.now, true, frames);
  REQUIRE(frames.size() > 0);
  CHECK(TestType::IsStop(frames.frames()[0]));
}

TEMPLATE_TEST_CASE("silence of an armed one is a fault; it is told to stop when it is back", "",
                   MitMotorBench, RmdMotorBench, MoteusMotorBench) {
  TestType bench;
  REQUIRE(bench.Arm());
  bench.powered = false;
  bench.Run(TestType::kSilence - 1);
  CHECK(bench.motor->state() == DriveState::kArmed);
  bench.Run(2);
  CHECK(bench.motor->state() != DriveState::kArmed);
  CHECK_THAT(Reason(bench), StartsWith(fmt::format("no answer for {} ms", TestType::kSilence)));
  bench.Run(250 - TestType::kSilence);
  CHECK(bench.motor->state() == DriveState::kAbsent);
  CHECK_FALSE(bench.motor->confirmed_idle());  // it may run
  bench.powered = true;
  bench.Run(100);
  CHECK(bench.motor->state() == DriveState::kFault);
  CHECK_FALSE(bench.device.armed());
  CHECK(bench.motor->confirmed_idle());
  CHECK(bench.Arm());
}

TEMPLATE_TEST_CASE("a bus that takes no frames ends the arming", "", MitMotorBench, RmdMotorBench,
                   MoteusMotorBench) {
  TestType bench;
  bench.bus_full = true;
  bench.motor->Arm(bench.now);
  bench.Run(260);
  CHECK(bench.motor->state() == DriveState::kAbsent);
  bench.bus_full = false;
  bench.Run(100);
  CHECK(bench.motor->state() == DriveState::kFault);
  CHECK(bench.Arm());
}

TEMPLATE_TEST_CASE("the first stop may be lost: only an answer to the second counts", "",
                   MitMotorBench, RmdMotorBench, MoteusMotorBench) {
  TestType bench;
  REQUIRE(bench.Arm());
  int seen = 0;
  bench.to_device = [&](const Frame& frame) {
    return !TestType::IsStop(frame) || ++seen > TestType::kStopFrames;
  };
  bench.motor->Disarm(bench.now);
  bench.Step();
  CheckIdleOnlyOnceStopped(bench);
}

TEMPLATE_TEST_CASE("stops that the bus does not take are given again, and do not count", "",
                   MitMotorBench, RmdMotorBench, MoteusMotorBench) {
  TestType bench;
  REQUIRE(bench.Arm());
  bench.bus_full = true;
  bench.motor->Disarm(bench.now);
  bench.Run(50);
  CHECK_FALSE(bench.motor->confirmed_idle());
  bench.bus_full = false;
  CheckIdleOnlyOnceStopped(bench);
}

TEMPLATE_TEST_CASE("an emergency stop disarms, and says so until the next arming", "",
                   MitMotorBench, RmdMotorBench, MoteusMotorBench) {
  TestType bench;
  bench.torque = 1;
  REQUIRE(bench.Arm());
  bench.motor->Estop(bench.now);
  CHECK_FALSE(bench.motor->confirmed_idle());
  bench.Step();
  CHECK_FALSE(bench.device.armed());
  bench.Run(60);
  CHECK(bench.motor->confirmed_idle());
  CHECK(bench.motor->state() == DriveState::kFault);
  CHECK(Reason(bench) == "emergency stop requested");
  CHECK(bench.Arm());
  CHECK(Reason(bench).empty());
}

}  // namespace
}  // namespace plumb
