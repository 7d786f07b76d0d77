// The host's side of a moteus against the virtual motor, in virtual time: silence, faults,
// restarts, lost frames, and motors that are set up otherwise.

#include <algorithm>
#include <catch2/catch.hpp>
#include <string>

#include "drivers/protocols/moteus_reports.h"
#include "drivers/protocols/uptime_watch.h"
#include "tests/drivers/protocols/moteus_motor_bench.h"

namespace plumb {
namespace {

using namespace moteus;
using Catch::Contains;
using Bench = MoteusMotorBench;

std::string Reason(const Bench& bench) { return std::string(bench.motor->reason()); }

TEST_CASE("a silent driver: the moteus' own watchdog ends the torque, for good") {
  Bench bench;
  bench.torque = 3;
  REQUIRE(bench.Arm());
  bench.Run(5);
  bench.driving = false;
  bench.Run(99);
  CHECK(bench.device.Torque(bench.sample) == 3);
  bench.Run(1);
  CHECK(bench.device.Torque(bench.sample) == 0);
  CHECK(bench.device.mode() == kTimedOut);
  // It goes on, and the motor does not.
  bench.driving = true;
  bench.applied = 0;
  bench.Run(100);
  CHECK(bench.applied == 0);
  CHECK(bench.motor->state() == DriveState::kFault);
  CHECK_THAT(Reason(bench), Contains("no answer for 10"));
  CHECK(bench.motor->confirmed_idle());
  CHECK(bench.Arm());
}

TEST_CASE("commands that do not get there: its mode says that its watchdog has expired") {
  Bench bench;
  bench.torque = 3;
  REQUIRE(bench.Arm());
  bench.to_device = [](const Frame& frame) { return !Bench::IsCommand(frame); };
  // Somebody asks in our place.
  for (int i = 0; i < 100; ++i) {
    bench.Step();
    bench.device.OnFrame(MakeFrame(CommandId(Bench::kNode), {kQuestion}), bench.now);
  }
  CHECK(bench.device.Torque(bench.sample) == 0);
  bench.Run(5);
  CHECK(bench.motor->state() == DriveState::kFault);
  CHECK(Reason(bench) == "its watchdog has expired: no command for 100 ms");
}

TEST_CASE("a fault of a moteus has a name, in the cycle in which it says so") {
  Bench bench;
  bench.torque = 1;
  REQUIRE(bench.Arm());
  bench.device.set_fault(38);
  bench.Step();
  bench.Step();
  CHECK(bench.motor->state() == DriveState::kFault);
  CHECK(Reason(bench) == "the motor reports fault 38 (over temperature)");
  bench.Run(20);
  CHECK(bench.device.mode() == kStopped);
  CHECK(Reason(bench) == "the motor reports fault 38 (over temperature)");
  CHECK(bench.Arm());
}

TEST_CASE("what limits a moteus is no fault") {
  Bench bench;
  bench.torque = 1;
  REQUIRE(bench.Arm());
  bench.device.set_fault(99);
  bench.Run(20);
  CHECK(bench.motor->state() == DriveState::kArmed);
}

TEST_CASE("a fault while a moteus gets ready keeps it from being armed") {
  Bench bench;
  bench.to_device = [&](const Frame& frame) {
    if (Bench::IsCommand(frame) && bench.device.mode() == kPreparing) bench.device.set_fault(35);
    return true;
  };
  CHECK_FALSE(bench.Arm());
  CHECK(Reason(bench) == "the motor reports fault 35 (encoder fault)");
}

TEST_CASE("a moteus that another master has stopped is a fault") {
  Bench bench;
  REQUIRE(bench.Arm());
  bench.device.OnFrame(*FrameFromText("00008011##1010000"), bench.now);
  bench.Run(2);
  CHECK(bench.motor->state() == DriveState::kFault);
  // What we say in that cycle makes it start again, as far as it gets.
  CHECK(Reason(bench) == "it left position mode for mode 2 (enabling)");
  bench.Run(5);
  CHECK(bench.device.mode() == kStopped);
}

TEST_CASE("a moteus that would not let go without commands is not armed") {
  Bench bench({.timeout_mode = kZeroVelocity});
  CHECK_FALSE(bench.Arm());
  CHECK(bench.motor->state() == DriveState::kFault);
  CHECK(Reason(bench) ==
        "its servo.timeout_mode is 12: without commands it would not let go; cure: conf set "
        "servo.timeout_mode 0, conf write");
  CHECK(std::ranges::none_of(bench.sent, Bench::IsCommand));
}

TEST_CASE("a moteus whose registers mean something else is not armed") {
  Bench bench({.register_map = 4});
  CHECK_FALSE(bench.Arm());
  CHECK(Reason(bench) == "its registers are of map 4, and 5 is what is known: another firmware");
}

TEST_CASE("a moteus that has restarted has lost its place") {
  Bench bench;
  REQUIRE(bench.Arm());
  const bool armed = GENERATE(true, false);
  CAPTURE(armed);
  if (!armed) bench.motor->Disarm(bench.now);
  bench.Run(2000);
  bench.device.Reboot(bench.now, 0);
  bench.Run(100);
  CHECK(bench.motor->lost_place());
  CHECK((bench.motor->state() == DriveState::kFault) == armed);
  if (armed) CHECK_THAT(Reason(bench), Contains("it has restarted"));
  CHECK(bench.motor->confirmed_idle());
  bench.motor->Homed();
  CHECK_FALSE(bench.motor->lost_place());
  CHECK(bench.Arm());
  bench.Run(1000);
  CHECK_FALSE(bench.motor->lost_place());
}

TEST_CASE("a counter of milliseconds that goes round after 50 days is no restart") {
  MoteusReports reports;
  const auto answer = [&](uint32_t uptime, int64_t now) {
    Frame frame = MakeFrame(
        AnswerId(1), kAnswer,
        {0, 0, 0, 0, 25, 0, 1, 24, 25, 0, static_cast<double>(static_cast<int32_t>(uptime))});
    REQUIRE(reports.OnFrame(frame, now) == FrameUse::kEstimate);
    return reports.TakeRestart().has_value();
  };
  CHECK_FALSE(answer(0xFFFFFFA0, 1'000'000));
  CHECK_FALSE(answer(0x54, 1'180'000));
  CHECK_FALSE(answer(0x54 + 500, 1'700'000));
  CHECK_FALSE(answer(0x54 + 600, 2'700'000));  // it waited for us
  CHECK(answer(100, 9'700'000));
  CHECK_FALSE(answer(200, 9'800'000));
}

TEST_CASE("a drive that had been up for a month has restarted where it says a second") {
  UptimeWatch watch(1'000'000);
  const uint32_t month = 30u * 24 * 3600 * 1000;
  watch.OnUptime(month, 1'000'000);
  watch.OnUptime(month + 100, 1'100'000);
  // we had been asleep: it has been up for longer than that
  watch.OnUptime(month + 3'600'000, 1'200'000);
  CHECK_FALSE(watch.TakeRestart());
  watch.OnUptime(1000, 4'200'000);
  CHECK(watch.TakeRestart() == 1000u);
}

TEST_CASE("lost frames do not spoil the arming of a moteus") {
  const int lost = GENERATE(0, 1, 2, 3, 4, 5, 6, 7);
  const bool answers = GENERATE(true, false);
  CAPTURE(lost, answers);
  Bench bench;
  int seen = 0;
  const auto pass = [&](const Frame&) {
    return bench.motor->state() != DriveState::kArming || seen++ % 8 != lost;
  };
  (answers ? bench.to_host : bench.to_device) = pass;
  CHECK(bench.Arm());
}

TEST_CASE("a moteus that does not do its part is not armed, and the reason says which") {
  const auto [silent, reason] = GENERATE(table<int, std::string>({
      {0x2A, "it does not say which firmware it has"},
      {0x41, "it does not say what its servo.timeout_mode is"},
      {0x21, "it does not answer (ids 0x8011 and 0x1100)"},
  }));
  Bench bench;
  const int subframe = silent;
  bench.to_host = [subframe](const Frame& frame) { return frame.data[0] != subframe; };
  bench.motor->Arm(bench.now);
  bench.Run(450);
  CHECK(bench.motor->state() == (silent == 0x21 ? DriveState::kAbsent : DriveState::kFault));
  CHECK_FALSE(bench.device.armed());
  CHECK(Reason(bench) == reason);
}

}  // namespace
}  // namespace plumb
