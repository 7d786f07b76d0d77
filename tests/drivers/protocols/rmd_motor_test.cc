// The host's side of the RMD protocol against the virtual motor, in virtual time.

#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

#include "drivers/protocols/registry.h"
#include "drivers/protocols/rmd_device.h"
#include "drivers/protocols/rmd_host.h"

namespace plumb {
namespace {

using Catch::Contains;

constexpr double kDegree = std::numbers::pi / 180;
constexpr int kNode = 0x11;
constexpr double kTorqueConstant = 0.9, kMostCurrent = 20;

MotorDescription Describe(int node = kNode) {
  MotorDescription description;
  description.protocol = "rmd";
  description.node = node;
  description.rmd =
      RmdDescription{.torque_constant = kTorqueConstant, .current = kMostCurrent, .source = "test"};
  return description;
}

Frame Of(rmd::Code code) { return rmd::MakeCommand(code, kNode); }

/// Host and motor, a millisecond at a time. The driver's part is played here: zero torque while
/// arming, `torque` when armed, and a reading asked for every 25 ms.
struct Bench {
  explicit Bench(int64_t stored_watchdog = 0)
      : device({.node = kNode,
                .torque_constant = kTorqueConstant,
                .current = kMostCurrent,
                .watchdog = stored_watchdog}) {
    device.Reboot(now, 0);
    while (motor->state() == DriveState::kAbsent && now < 1'200'000) Step();
    Run(100);
  }
  void Step() {
    now += 1000;
    sample.position += sample.velocity * 1e-3;
    FrameBatch frames, answers;
    const DriveState state = motor->state();
    if (stream && (state == DriveState::kArming || state == DriveState::kArmed))
      frames.Push(motor->Torque(state == DriveState::kArmed ? torque : 0));
    if (stream) motor->Tick(now, true, frames);
    if (stream && state != DriveState::kArming && now % 25'000 == 0) motor->Poll(frames);
    motor->Transmitted(!bus_full, now);
    if (!bus_full) {
      for (const Frame& frame : frames.frames()) {
        sent.push_back(frame);
        if (powered && (!to_device || to_device(frame))) device.OnFrame(frame, now);
        applied = std::max(applied, std::abs(device.Torque()));
      }
    }
    device.Tick(now, sample, answers);
    if (!powered) return;
    for (const Frame& frame : answers.frames()) {
      if (to_host && !to_host(frame)) continue;
      if (motor->OnFrame(frame, now) == FrameUse::kEstimate) ++estimates;
    }
  }
  void Run(int milliseconds) {
    for (int i = 0; i < milliseconds; ++i) Step();
  }
  bool Arm() {
    motor->Arm(now);
    for (int i = 0; i < 100 && motor->state() != DriveState::kArmed; ++i) Step();
    return motor->state() == DriveState::kArmed;
  }
  int Count(const Frame& like) const {
    return static_cast<int>(
        std::ranges::count_if(sent, [&](const Frame& frame) { return SameOnWire(frame, like); }));
  }

  std::unique_ptr<Motor> motor = MakeRmdMotor(Describe(), {200'000});
  RmdDevice device;
  RmdDevice::Sample sample{1, 0};
  int64_t now = 1'000'000;
  bool stream = true, bus_full = false, powered = true;
  double torque = 0, applied = 0;
  int estimates = 0;
  std::function<bool(const Frame&)> to_device, to_host;
  std::vector<Frame> sent;
};

bool IsSetpoint(const Frame& frame) { return frame.data[0] == rmd::kTorqueControl; }

TEST_CASE("an RMD motor at rest is heard, told to stop, and has no setpoints") {
  Bench bench;
  CHECK(bench.motor->state() == DriveState::kIdle);
  CHECK(bench.motor->confirmed_idle());
  CHECK(bench.Count(Of(rmd::kShutdown)) >= 2);
  CHECK(bench.Count(Of(rmd::kShutdown)) == bench.Count(Of(rmd::kLockBrake)));
  CHECK(std::ranges::none_of(bench.sent, IsSetpoint));
  CHECK(bench.Count(Of(rmd::kReleaseBrake)) == 0);
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
  Bench bench;
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
  CHECK(bench.device.Torque() == Approx(2).margin(0.005 * kTorqueConstant));
  CHECK(bench.motor->torque_estimate() == Approx(2).margin(0.01 * kTorqueConstant));
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
  Bench bench;
  bench.sample.position = -1234.5;
  bench.Run(5);
  CHECK(bench.motor->estimate().position == Approx(-1234.5).margin(0.01001 * kDegree));
}

TEST_CASE("whatever an RMD motor was told before, it is told to stop") {
  Bench bench;
  const auto somebody = [&](const Frame& frame) { bench.device.OnFrame(frame, bench.now); };
  somebody(Of(rmd::kReleaseBrake));
  somebody(rmd::MakeCommand(rmd::kTorque, kNode, 5));
  CHECK(bench.device.Torque() == Approx(4.5));
  bench.Run(101);  // at rest: its answers do not say that it runs
  CHECK_FALSE(bench.device.armed());

  somebody(Of(rmd::kReleaseBrake));
  somebody(rmd::MakeCommand(rmd::kTorque, kNode, 5));
  const auto other = MakeRmdMotor(Describe(), {200'000});  // a driver that has just been started
  FrameBatch frames;
  other->Tick(bench.now, true, frames);
  CHECK(SameOnWire(frames.frames()[0], Of(rmd::kShutdown)));
}

TEST_CASE("a silent driver: the watchdog ends the torque, and the motor is not believed at once") {
  Bench bench;
  bench.torque = 3;
  REQUIRE(bench.Arm());
  bench.Run(5);
  bench.stream = false;
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
  bench.stream = true;
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
  Bench bench(100'000);
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

TEST_CASE("silence of an armed RMD motor is a fault; it is told to stop when it is back") {
  Bench bench;
  REQUIRE(bench.Arm());
  bench.powered = false;
  bench.Run(101);
  CHECK(bench.motor->state() == DriveState::kFault);
  CHECK_THAT(std::string(bench.motor->reason()), Contains("no answer for 100 ms"));
  bench.Run(150);
  CHECK(bench.motor->state() == DriveState::kAbsent);
  CHECK_FALSE(bench.motor->confirmed_idle());  // it may run
  bench.powered = true;
  bench.Run(100);
  CHECK(bench.motor->state() == DriveState::kFault);
  CHECK_FALSE(bench.device.armed());
  CHECK(bench.motor->confirmed_idle());
  CHECK(bench.Arm());
}

TEST_CASE("errors of an RMD motor are a fault with a name, and keep it from being armed") {
  Bench bench;
  bench.torque = 1;
  REQUIRE(bench.Arm());
  bench.device.set_errors(0x1010);
  bench.Run(101);  // within which its status is asked for
  CHECK(bench.motor->state() == DriveState::kFault);
  CHECK(bench.motor->reason() == "the motor reports over-current, motor over-temperature (0x1010)");
  bench.sent.clear();
  CHECK_FALSE(bench.Arm());
  CHECK(bench.motor->state() == DriveState::kFault);
  CHECK(bench.Count(Of(rmd::kReleaseBrake)) == 0);
  bench.device.set_errors(0);
  CHECK(bench.Arm());
}

TEST_CASE("an RMD motor that has restarted has lost its place, and may be another one") {
  Bench bench;
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
  Bench bench;
  const auto uptime = [&](const char* text) {
    bench.motor->OnFrame(*FrameFromText(text), bench.now);
  };
  auto motor = MakeRmdMotor(Describe(), {200'000});
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

TEST_CASE("an RMD motor gets finite torques within its current, and the others are counted") {
  Bench bench;
  CHECK(ToText(bench.motor->Torque(9)) == "151#A100000000000000");  // not armed
  CHECK(bench.Arm());
  CHECK(ToText(bench.motor->Torque(9)) == "151#A1000000E8030000");  // 10 A
  CHECK(ToText(bench.motor->Torque(-9)) == "151#A100000018FC0000");
  CHECK(ToText(bench.motor->Torque(18)) == "151#A1000000D0070000");
  CHECK(bench.motor->saturations() == 0);
  CHECK(ToText(bench.motor->Torque(99)) == "151#A1000000D0070000");
  CHECK(ToText(bench.motor->Torque(-1e300)) == "151#A100000030F80000");
  CHECK(ToText(bench.motor->Torque(std::numeric_limits<double>::quiet_NaN())) ==
        "151#A100000000000000");
  CHECK(ToText(bench.motor->Torque(std::numeric_limits<double>::infinity())) ==
        "151#A100000000000000");
  CHECK(bench.motor->saturations() == 4);
}

TEST_CASE("lost frames do not spoil the arming of an RMD motor") {
  const auto lost = GENERATE(rmd::kSetWatchdog, rmd::kAskStatus, rmd::kReleaseBrake);
  Bench bench;
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
  Bench bench;
  const uint8_t code = silent;
  bench.to_host = [code](const Frame& frame) { return frame.data[0] != code; };
  bench.motor->Arm(bench.now);
  bench.Run(450);
  CHECK(bench.motor->state() == DriveState::kFault);
  CHECK(bench.motor->reason() == reason);
  CHECK_FALSE(bench.device.armed());
}

TEST_CASE("a bus that takes no frames ends the arming of an RMD motor") {
  Bench bench;
  bench.bus_full = true;
  bench.motor->Arm(bench.now);
  bench.Run(260);
  CHECK(bench.motor->state() == DriveState::kAbsent);
  CHECK_FALSE(bench.motor->confirmed_idle());
  bench.bus_full = false;
  bench.Run(100);
  CHECK(bench.motor->state() == DriveState::kFault);
  CHECK(bench.Arm());
}

TEST_CASE("a slow brake: the motor answers nothing for 150 ms, and is armed all the same") {
  Bench bench;
  int64_t released = 0;
  bench.to_host = [&](const Frame& frame) {
    if (frame.data[0] == rmd::kReleaseBrake && released == 0) released = bench.now;
    return released == 0 || bench.now >= released + 150'000;
  };
  bench.motor->Arm(bench.now);
  bench.Run(400);
  CHECK(bench.motor->state() == DriveState::kArmed);
}

TEST_CASE("the first shutdown may be lost: only an answer to the second counts") {
  Bench bench;
  REQUIRE(bench.Arm());
  int seen = 0;
  bench.to_device = [&](const Frame& frame) {
    return (frame.data[0] != rmd::kShutdown && frame.data[0] != rmd::kLockBrake) || ++seen > 2;
  };
  bench.motor->Disarm(bench.now);
  bench.Step();
  CHECK(bench.device.armed());
  CHECK_FALSE(bench.motor->confirmed_idle());
  bench.Run(60);
  CHECK_FALSE(bench.device.armed());
  CHECK(bench.motor->confirmed_idle());
}

TEST_CASE("an answer to an earlier shutdown does not count") {
  Bench bench;
  REQUIRE(bench.Arm());
  int seen = 0;
  bench.to_device = [&](const Frame& frame) {
    return (frame.data[0] != rmd::kShutdown && frame.data[0] != rmd::kLockBrake) || ++seen > 4;
  };
  bench.motor->Disarm(bench.now);
  bench.Step();
  bench.motor->OnFrame(*FrameFromText("251#8000000000000000"), bench.now);
  bench.Run(25);
  CHECK(bench.device.armed());
  CHECK_FALSE(bench.motor->confirmed_idle());
  bench.Run(60);
  CHECK_FALSE(bench.device.armed());
  CHECK(bench.motor->confirmed_idle());
}

TEST_CASE("emergency stops of an RMD motor: ours, and somebody else's") {
  Bench bench;
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
  Bench bench;
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
  CHECK_THROWS_AS(MakeRmdMotor(Describe(0), {1}), std::invalid_argument);
  CHECK_THROWS_AS(MakeRmdMotor(Describe(33), {1}), std::invalid_argument);
  MotorDescription description = Describe();
  description.rmd->torque_constant = 0;
  CHECK_THROWS_AS(MakeRmdMotor(description, {1}), std::invalid_argument);
  description.rmd->torque_constant = 1;
  description.rmd->watchdog = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(MakeRmdMotor(description, {1}), std::invalid_argument);
  description.rmd.reset();
  CHECK_THROWS_AS(MakeRmdMotor(description, {1}), std::invalid_argument);
  CHECK_THROWS_AS(MakeRmdDevice(description, {}, {}), std::invalid_argument);
  CHECK(MakeMotor(Describe(), {1}) != nullptr);
}

}  // namespace
}  // namespace plumb
