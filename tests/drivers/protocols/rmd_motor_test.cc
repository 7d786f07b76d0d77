// The host's side of the RMD protocol against the virtual motor, in virtual time: how it is told
// to stop, armed and given torques, and whose frames it obeys.

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numbers>

#include "drivers/protocols/registry.h"
#include "tests/drivers/protocols/rmd_motor_bench.h"

namespace plumb {
namespace {

bool IsSetpoint(const Frame& frame) { return frame.data[0] == rmd::kTorqueControl; }

TEST_CASE("an RMD motor at rest is heard, told to stop, and has no setpoints") {
  RmdMotorBench bench;
  CHECK(bench.motor->state() == DriveState::kIdle);
  CHECK(bench.motor->confirmed_idle());
  CHECK(bench.Count(bench.Command(rmd::kShutdown)) >= 2);
  CHECK(bench.Count(bench.Command(rmd::kShutdown)) == bench.Count(bench.Command(rmd::kLockBrake)));
  CHECK(std::ranges::none_of(bench.sent, IsSetpoint));
  CHECK(bench.Count(bench.Command(rmd::kReleaseBrake)) == 0);
  CHECK(bench.device.watchdog_writes() == 0);  // until it is armed
  bench.sample.velocity = -3;
  bench.estimates = 0;
  bench.Run(100);
  CHECK(bench.estimates == 100);
  CHECK(bench.motor->estimate().position ==
        Approx(bench.sample.position).margin(0.01001 * kDegree));
  CHECK(bench.motor->estimate().velocity == Approx(-3).margin(1.001 * kDegree));
  CHECK(bench.motor->readings().motor_temperature == 25);
  CHECK(bench.motor->readings().temperatures_at == bench.now);
  CHECK(bench.motor->readings().bus_voltage == Approx(48));
  CHECK(std::isnan(bench.motor->readings().drive_temperature));
  CHECK(bench.motor->identity() == "X8S2V10, software of 20220206");
  CHECK_FALSE(bench.motor->lost_place());
}

TEST_CASE("arming an RMD motor: watchdog, status, brake, zeros, and only then torque") {
  RmdMotorBench bench;
  bench.torque = 2;
  bench.sent.clear();
  bench.applied = 0;
  CHECK(bench.Arm());
  CHECK(bench.applied == 0);
  CHECK(bench.device.watchdog() == 100'000);
  CHECK(bench.device.brake_released());
  const auto first = [&](rmd::Code code) {
    return std::ranges::find(bench.sent, code, [](const Frame& f) { return f.data[0]; });
  };
  CHECK(first(rmd::kSetWatchdog) < first(rmd::kReleaseBrake));
  CHECK(first(rmd::kAskStatus) < first(rmd::kReleaseBrake));
  bench.estimates = 0;
  bench.sample.velocity = 12;
  bench.Run(50);
  CHECK(bench.estimates == 50);
  CHECK(bench.device.Torque() == Approx(2).margin(0.005 * bench.kTorqueConstant));
  CHECK(bench.motor->torque_estimate() == Approx(2).margin(0.01 * bench.kTorqueConstant));
  CHECK(bench.motor->estimate().position ==
        Approx(bench.sample.position).margin(0.01001 * kDegree));
  CHECK(bench.motor->estimate().velocity == Approx(12).margin(1.001 * kDegree));
  // Two frames in a cycle, but for the readings asked for in turn.
  bench.sent.clear();
  bench.Run(50);
  CHECK(bench.sent.size() == 102);

  bench.motor->Disarm(bench.now);
  CHECK_FALSE(bench.motor->confirmed_idle());
  bench.Run(60);
  CHECK_FALSE(bench.device.armed());
  CHECK_FALSE(bench.device.brake_released());
  CHECK(bench.motor->state() == DriveState::kIdle);
  CHECK(bench.motor->confirmed_idle());
  // The flash is spared: what is stored stays stored.
  CHECK(bench.Arm());
  CHECK(bench.device.watchdog_writes() == 1);
}

TEST_CASE("an angle of many turns does not wrap") {
  RmdMotorBench bench;
  bench.sample.position = -1234.5;
  bench.Run(5);
  CHECK(bench.motor->estimate().position == Approx(-1234.5).margin(0.01001 * kDegree));
}

TEST_CASE("whatever an RMD motor was told before, it is told to stop") {
  RmdMotorBench bench;
  const auto somebody = [&](const Frame& frame) { bench.device.OnFrame(frame, bench.now); };
  somebody(bench.Command(rmd::kReleaseBrake));
  somebody(rmd::MakeCommand(rmd::kTorque, bench.kNode, 5));
  CHECK(bench.device.Torque() == Approx(4.5));
  bench.Run(101);  // at rest: its answers do not say that it runs
  CHECK_FALSE(bench.device.armed());

  somebody(bench.Command(rmd::kReleaseBrake));
  somebody(rmd::MakeCommand(rmd::kTorque, bench.kNode, 5));
  // a driver that has just been started
  const auto other = MakeRmdMotor(bench.Describe(), {200'000});
  FrameBatch frames;
  other->Tick(bench.now, true, frames);
  CHECK(SameOnWire(frames.frames()[0], bench.Command(rmd::kShutdown)));
}

TEST_CASE("an RMD motor gets finite torques within its current, and the others are counted") {
  RmdMotorBench bench;
  CHECK(ToText(bench.motor->Torque(9)) == "151#A100000000000000");  // not armed
  CHECK(bench.Arm());
  CHECK(ToText(bench.motor->Torque(9)) == "151#A1000000E8030000");  // 10 A
  CHECK(ToText(bench.motor->Torque(-9)) == "151#A100000018FC0000");
  CHECK(ToText(bench.motor->Torque(18)) == "151#A1000000D0070000");
  CHECK(ToText(bench.motor->Torque(18 * (1 + 1e-15))) == "151#A1000000D0070000");
  CHECK(bench.motor->saturations() == 0);
  CHECK(ToText(bench.motor->Torque(99)) == "151#A1000000D0070000");
  CHECK(ToText(bench.motor->Torque(-1e300)) == "151#A100000030F80000");
  CHECK(ToText(bench.motor->Torque(std::numeric_limits<double>::quiet_NaN())) ==
        "151#A100000000000000");
  CHECK(ToText(bench.motor->Torque(std::numeric_limits<double>::infinity())) ==
        "151#A100000000000000");
  CHECK(bench.motor->saturations() == 4);
}

TEST_CASE("a slow brake: the motor answers nothing for 150 ms, and is armed all the same") {
  RmdMotorBench bench;
  int64_t released = 0;
  bench.to_host = [&](const Frame& frame) {
    if (frame.data[0] == rmd::kReleaseBrake && released == 0) released = bench.now;
    return released == 0 || bench.now >= released + 150'000;
  };
  bench.motor->Arm(bench.now);
  bench.Run(400);
  CHECK(bench.motor->state() == DriveState::kArmed);
}

TEST_CASE("emergency stops of an RMD motor: ours, and somebody else's") {
  RmdMotorBench bench;
  CHECK(bench.Arm());
  bench.motor->Estop(bench.now);
  bench.Step();
  CHECK_FALSE(bench.device.armed());
  CHECK(bench.motor->reason() == "emergency stop requested");
  const auto stops = [&](const char* text) { return bench.motor->IsEstop(*FrameFromText(text)); };
  CHECK(stops("151#8000000000000000"));
  CHECK(stops("280#8000000000000000"));
  CHECK(stops("280#8100000000000000"));
  CHECK(stops("151#7800000000000000"));
  CHECK(stops("151#7600000000000000"));
  CHECK_FALSE(stops("152#8000000000000000"));
  CHECK_FALSE(stops("151#A100000000000000"));
  CHECK_FALSE(stops("151#R8"));
  CHECK_FALSE(stops("280#"));
  CHECK_FALSE(stops("00000280#8000000000000000"));
}

TEST_CASE("frames of other RMD motors and other kinds are not mine, others are rejected") {
  RmdMotorBench bench;
  const auto use = [&](const char* text) {
    return bench.motor->OnFrame(*FrameFromText(text), bench.now);
  };
  const MotorEstimate before = bench.motor->estimate();
  CHECK(use("252#92000000A08C0000") == FrameUse::kNotMine);
  CHECK(use("151#92000000A08C0000") == FrameUse::kNotMine);
  CHECK(use("00000251#92000000A08C0000") == FrameUse::kNotMine);
  CHECK(use("251#R8") == FrameUse::kNotMine);
  CHECK(use("251##192000000A08C0000") == FrameUse::kNotMine);
  CHECK(use("251#") == FrameUse::kRejected);
  CHECK(use("251#92000000A08C00") == FrameUse::kRejected);
  CHECK(use("251#F1") == FrameUse::kRejected);
  CHECK(use("251#0000000000000000") == FrameUse::kRejected);
  CHECK(use("251#A4326400F4012D00") == FrameUse::kRejected);  // a position of somebody's
  CHECK(bench.motor->estimate().position == before.position);
  CHECK(use("251#92000000A08C0000") == FrameUse::kConsumed);  // an angle without a speed
  CHECK(use("251#9C326400F4012D00") == FrameUse::kConsumed);
  CHECK(use("251#92000000A08C0000") == FrameUse::kEstimate);
  CHECK(bench.motor->estimate().position == Approx(2 * std::numbers::pi));
  CHECK(bench.motor->estimate().velocity == Approx(500 * kDegree));
}

TEST_CASE("RMD motors that cannot be") {
  CHECK_THROWS_AS(MakeRmdMotor(RmdMotorBench::Describe(0), {1}), std::invalid_argument);
  CHECK_THROWS_AS(MakeRmdMotor(RmdMotorBench::Describe(33), {1}), std::invalid_argument);
  MotorDescription description = RmdMotorBench::Describe();
  description.rmd->torque_constant = 0;
  CHECK_THROWS_AS(MakeRmdMotor(description, {1}), std::invalid_argument);
  description.rmd->torque_constant = 1;
  description.rmd->watchdog = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(MakeRmdMotor(description, {1}), std::invalid_argument);
  description.rmd.reset();
  CHECK_THROWS_AS(MakeRmdMotor(description, {1}), std::invalid_argument);
  CHECK_THROWS_AS(MakeRmdDevice(description, {}, {}), std::invalid_argument);
  CHECK(MakeMotor(RmdMotorBench::Describe(), {1}) != nullptr);
}

}  // namespace
}  // namespace plumb
