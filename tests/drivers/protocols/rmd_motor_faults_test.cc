// The host's side of the RMD protocol against the virtual motor, in virtual time: silence, errors,
// restarts and lost frames.

#include <algorithm>
#include <catch2/catch.hpp>
#include <string>

#include "tests/drivers/protocols/rmd_motor_bench.h"

namespace plumb {
namespace {

using Catch::Contains;

TEST_CASE("a silent driver: the watchdog ends the torque, and the motor is not believed at once") {
  RmdMotorBench bench;
  bench.torque = 3;
  REQUIRE(bench.Arm());
  bench.Run(5);
  bench.driving = false;
  bench.Run(99);
  CHECK(bench.device.Torque() == Approx(3).margin(0.01));
  const bool warned = GENERATE(true, false);
  CAPTURE(warned);
  if (!warned) bench.to_host = [](const Frame& f) { return f.data[0] != rmd::kInterrupted; };
  bench.Run(1);
  CHECK(bench.device.Torque() == 0);
  CHECK(bench.device.interrupted());
  CHECK((bench.motor->state() == DriveState::kFault) == warned);
  // It goes on: without another look the motor would obey the second setpoint.
  bench.driving = true;
  bench.applied = 0;
  bench.Run(100);
  CHECK(bench.applied == 0);
  CHECK(bench.motor->state() == DriveState::kFault);
  CHECK_THAT(std::string(bench.motor->reason()),
             warned ? Contains("its watchdog has expired") : Contains("no answer for 10"));
  CHECK(bench.motor->confirmed_idle());
  // The echo of a question for the angle was not taken for an angle of 0.
  CHECK(bench.motor->estimate().position == Approx(1).margin(0.01001 * kDegree));
  CHECK(bench.Arm());
}

TEST_CASE("what a motor echoes after a silence is never an estimate") {
  RmdMotorBench bench(100'000);
  bench.to_device = [&](const Frame& frame) {
    return bench.now % 150'000 != 0 || frame.data[0] == rmd::kAskAngle;
  };
  double least = 1;
  for (int i = 0; i < 2000; ++i) {
    // The driver's frames arrive for a moment now and then, with a question first.
    bench.powered = bench.now % 150'000 >= 149'000 || bench.now % 150'000 < 5'000;
    bench.Step();
    least = std::min(least, bench.motor->estimate().position);
  }
  CHECK(least > 0.999);
  CHECK(bench.device.rejected() == 0);
}

TEST_CASE("errors of an RMD motor are a fault with a name, and keep it from being armed") {
  RmdMotorBench bench;
  bench.torque = 1;
  REQUIRE(bench.Arm());
  bench.device.set_errors(0x1010);
  bench.Run(101);  // within which its status is asked for
  CHECK(bench.motor->state() == DriveState::kFault);
  CHECK(bench.motor->reason() == "the motor reports over-current, motor over-temperature (0x1010)");
  bench.sent.clear();
  CHECK_FALSE(bench.Arm());
  CHECK(bench.motor->state() == DriveState::kFault);
  CHECK(bench.Count(bench.Command(rmd::kReleaseBrake)) == 0);
  bench.device.set_errors(0);
  CHECK(bench.Arm());
}

TEST_CASE("an RMD motor that has restarted has lost its place, and may be another one") {
  RmdMotorBench bench;
  REQUIRE(bench.Arm());
  const bool armed = GENERATE(true, false);
  CAPTURE(armed);
  if (!armed) bench.motor->Disarm(bench.now);
  bench.Run(1000);
  bench.device.Reboot(bench.now, 0);
  bench.Run(200);
  CHECK(bench.motor->lost_place());
  CHECK((bench.motor->state() == DriveState::kFault) == armed);
  if (armed) CHECK_THAT(std::string(bench.motor->reason()), Contains("it has restarted"));
  CHECK(bench.motor->confirmed_idle());
  bench.motor->Homed();
  CHECK_FALSE(bench.motor->lost_place());
  CHECK(bench.Arm());
  CHECK(bench.device.watchdog_writes() == 2);
  bench.Run(1000);
  CHECK_FALSE(bench.motor->lost_place());
}

TEST_CASE("an uptime that goes round after 50 days is no restart") {
  RmdMotorBench bench;
  const auto uptime = [&](const char* text) {
    bench.motor->OnFrame(*FrameFromText(text), bench.now);
  };
  auto motor = MakeRmdMotor(bench.Describe(), {200'000});
  std::swap(motor, bench.motor);
  uptime("251#8000000000000000");
  uptime("251#B1000000A0FFFFFF");  // 96 ms before
  bench.now += 90'000;
  uptime("251#8000000000000000");
  bench.now += 90'000;
  uptime("251#B100000054000000");  // 84 ms after
  CHECK_FALSE(bench.motor->lost_place());
  bench.now += 90'000;
  uptime("251#B1000000A0FFFFFF");  // another's: 50 days from now
  CHECK_FALSE(bench.motor->lost_place());
}

TEST_CASE("lost frames do not spoil the arming of an RMD motor") {
  const auto lost = GENERATE(rmd::kSetWatchdog, rmd::kAskStatus, rmd::kReleaseBrake);
  RmdMotorBench bench;
  int seen = 0;
  bench.to_device = [&](const Frame& frame) { return frame.data[0] != lost || ++seen > 1; };
  CHECK(bench.Arm());
  CHECK(bench.device.brake_released());
}

TEST_CASE("an RMD motor that does not do its part is not armed, and the reason says which") {
  const auto [silent, reason] = GENERATE(table<rmd::Code, std::string>({
      {rmd::kAskStatus, "it does not answer (ids 0x151 and 0x251)"},
      {rmd::kSetWatchdog, "it does not answer (ids 0x151 and 0x251)"},
      {rmd::kReleaseBrake, "it does not answer that its brake is to be released"},
      {rmd::kTorqueControl, "it does not answer setpoints"},
  }));
  RmdMotorBench bench;
  const uint8_t code = silent;
  bench.to_host = [code](const Frame& frame) { return frame.data[0] != code; };
  bench.motor->Arm(bench.now);
  bench.Run(450);
  CHECK(bench.motor->state() == DriveState::kFault);
  CHECK(bench.motor->reason() == reason);
  CHECK_FALSE(bench.device.armed());
}

TEST_CASE("an answer to an earlier shutdown does not count") {
  RmdMotorBench bench;
  REQUIRE(bench.Arm());
  int seen = 0;
  bench.to_device = [&](const Frame& frame) {
    return (frame.data[0] != rmd::kShutdown && frame.data[0] != rmd::kLockBrake) || ++seen > 4;
  };
  bench.motor->Disarm(bench.now);
  bench.Step();
  bench.motor->OnFrame(*FrameFromText("251#8000000000000000"), bench.now);
  bench.Run(25);
  CheckIdleOnlyOnceStopped(bench);
}

}  // namespace
}  // namespace plumb
