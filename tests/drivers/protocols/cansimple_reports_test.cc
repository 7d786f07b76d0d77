// The reports of an ODrive besides its position, and a restart told from a fault: the host's side
// against the virtual drive, in virtual time.

#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <limits>

#include "drivers/protocols/cansimple_device.h"
#include "drivers/protocols/cansimple_host.h"

namespace plumb {
namespace {

using Catch::Contains;

struct Bench {
  void Step() {
    now += 1000;
    FrameBatch out, in;
    const DriveState state = motor->state();
    if (state == DriveState::kArming || state == DriveState::kArmed) out.Push(motor->Torque(0));
    motor->Tick(now, true, out);
    motor->Transmitted(true, now);
    for (const Frame& frame : out.frames()) {
      if (powered) drive.OnFrame(frame, now);
    }
    drive.Tick(now, sample, in);
    if (!powered) return;
    for (const Frame& frame : in.frames()) {
      if (!tap || tap(frame)) motor->OnFrame(frame, now);
    }
  }
  void Run(int milliseconds) {
    for (int i = 0; i < milliseconds; ++i) Step();
  }
  bool Arm() {
    motor->Arm(now);
    for (int i = 0; i < 1000 && motor->state() != DriveState::kArmed; ++i) Step();
    return motor->state() == DriveState::kArmed;
  }
  FrameUse Use(const char* text) { return motor->OnFrame(*FrameFromText(text), now); }
  std::string Reason() const { return std::string(motor->reason()); }

  static MotorDescription Describe() {
    MotorDescription description;
    description.protocol = "cansimple";
    description.node = 1;
    return description;
  }
  std::unique_ptr<Motor> motor = MakeCanSimpleMotor(Describe(), {500'000});
  int64_t now = 1'000'000;
  CanSimpleDevice drive{{.heartbeat_period = 20'000,
                         .encoder_period = 5'000,
                         .watchdog = 50'000,
                         .telemetry_period = 100'000},
                        now};
  CanSimpleDevice::Sample sample{3.25, 0};
  bool powered = true;
  std::function<bool(const Frame&)> tap;
};

TEST_CASE("temperatures and supply are read, NaN until they have come") {
  Bench bench;
  CHECK(std::isnan(bench.motor->readings().motor_temperature));
  CHECK(std::isnan(bench.motor->readings().bus_voltage));
  bench.drive.set_temperature(41.5);
  bench.Run(150);
  MotorReadings readings = bench.motor->readings();
  CHECK(readings.motor_temperature == 41.5);
  CHECK(readings.drive_temperature == 41.5);
  CHECK(readings.bus_voltage == 24);
  CHECK(readings.bus_current == 0);
  CHECK(bench.Use("035#0000264200001142") == FrameUse::kConsumed);
  CHECK(bench.Use("037#0000C0410000A03F") == FrameUse::kConsumed);
  readings = bench.motor->readings();
  CHECK(readings.drive_temperature == 41.5);
  CHECK(readings.motor_temperature == 36.25);
  CHECK(readings.bus_current == 1.25);
  CHECK(bench.Use("035#0000C07F00001142") == FrameUse::kRejected);  // not a number
  CHECK(bench.Use("029#0000C07F00000000") == FrameUse::kNotFinite);
  CHECK(bench.Use("029#000000000000807F") == FrameUse::kNotFinite);
  CHECK(bench.Use("037#0000C041") == FrameUse::kRejected);
  CHECK(bench.motor->readings().drive_temperature == 41.5);
  CHECK(bench.Use("03C#0000C03F0000B83F") == FrameUse::kConsumed);
  CHECK(bench.motor->torque_estimate() == 1.4375);
}

TEST_CASE("a motor without a thermistor leaves its power stage's temperature known") {
  Bench bench;
  CHECK(bench.Use("035#0000C07F0000C07F") == FrameUse::kRejected);  // neither is a number
  CHECK(bench.motor->readings().temperatures_at == 0);
  CHECK(bench.Use("035#000026420000C07F") == FrameUse::kConsumed);
  CHECK(bench.motor->readings().drive_temperature == 41.5);
  CHECK(std::isnan(bench.motor->readings().motor_temperature));
  CHECK(bench.Use("035#000026420000807F") == FrameUse::kRejected);  // infinite
  CHECK(bench.Use("035#0000264200001142") == FrameUse::kConsumed);
  CHECK(bench.motor->readings().motor_temperature == 36.25);
  CHECK(bench.Use("035#000040420000C07F") == FrameUse::kRejected);  // it had one
  CHECK(bench.motor->readings().motor_temperature == 36.25);
  CHECK(bench.motor->readings().drive_temperature == 48);
}

TEST_CASE("the drive says what it is when it is armed") {
  Bench bench;
  CHECK(bench.motor->identity().empty());
  bench.Run(50);
  CHECK(bench.Arm());
  CHECK(bench.motor->identity() == "firmware 0.6.10, hardware 4.4.58");
}

TEST_CASE("two drives with one node id are told by their serial numbers") {
  Bench bench;
  bench.Run(50);
  CHECK(bench.Arm());
  CHECK(bench.Use("026#013234563D5E3300") == FrameUse::kConsumed);
  CHECK(bench.Use("026#013234563D5E33") == FrameUse::kConsumed);
  bench.Run(2);
  CHECK(bench.motor->state() == DriveState::kArmed);
  CHECK(bench.Use("026#013334563D5E33") == FrameUse::kConsumed);
  CHECK(bench.Reason() == "two drives have its node id");
  CHECK(bench.motor->state() == DriveState::kFault);
}

TEST_CASE("a restart: silence, IDLE, and another position") {
  const bool armed = GENERATE(true, false);
  Bench bench;
  bench.Run(100);
  if (armed) CHECK(bench.Arm());
  bench.powered = false;
  bench.Run(300);
  bench.drive.Reboot(bench.now);
  bench.sample.position = 0.1;
  bench.powered = true;
  bench.Run(50);
  CHECK(bench.motor->state() == DriveState::kFault);
  CHECK_THAT(bench.Reason(), Contains("has restarted") && Contains("jumped by -3.15 turns") &&
                                 Contains("home the joint"));
}

TEST_CASE("a restart after ten minutes, whatever noise its velocity had") {
  Bench bench;
  bench.sample.velocity = 0.1;  // [rad/s]
  bench.Run(100);
  bench.powered = false;
  bench.Run(300);
  bench.now += 600'000'000;
  bench.drive.Reboot(bench.now);
  bench.sample = {-16, 0};
  bench.powered = true;
  bench.Run(50);
  CHECK(bench.motor->lost_place());
  CHECK_THAT(bench.Reason(), Contains("has restarted"));
}

TEST_CASE("a restart that no jump tells of: it says zero, as it did before") {
  Bench bench;
  bench.sample = {0.004, 0};
  bench.Run(100);
  bench.powered = false;
  const bool cut = GENERATE(true, false);
  bench.Run(cut ? 1500 : 300);
  bench.drive.Reboot(bench.now);
  bench.powered = true;
  bench.Run(50);
  CHECK(bench.motor->lost_place() == cut);
  if (cut) CHECK_THAT(bench.Reason(), Contains("may have restarted"));
}

TEST_CASE("what is no restart") {
  Bench bench;
  bench.Run(100);
  SECTION("silence alone") {
    bench.powered = false;
    bench.Run(300);
    bench.powered = true;
    bench.Run(100);
    CHECK(bench.motor->state() == DriveState::kIdle);
  }
  SECTION("a robot that was placed elsewhere") {
    bench.sample.position = -4;
    bench.Run(100);
    CHECK(bench.motor->state() == DriveState::kIdle);
  }
  SECTION("silence, and a virtual robot that is placed elsewhere") {
    bench.powered = false;
    bench.Run(300);
    bench.powered = true;
    bench.Run(20);
    bench.motor->Displaced();
    bench.sample.position = -4;
    bench.Run(100);
    CHECK(bench.motor->state() == DriveState::kIdle);
  }
  SECTION("one lost heartbeat of a joint that turns") {
    int count = 0;
    bench.tap = [&](const Frame& frame) { return frame.id != 0x21 || ++count % 2 == 0; };
    bench.sample.velocity = 10;
    for (int i = 0; i < 300; ++i) {
      bench.sample.position += 0.01;
      bench.Step();
    }
    CHECK(bench.motor->state() == DriveState::kIdle);
  }
}

TEST_CASE("a drive that sends no heartbeat is asked who it is, and told nothing else") {
  Bench bench;
  bench.tap = [](const Frame& frame) { return frame.id != 0x021; };
  bench.motor->Arm(bench.now);
  bench.Run(499);
  CHECK(bench.motor->identity() == "firmware 0.6.10, hardware 4.4.58");
  CHECK(bench.motor->state() == DriveState::kAbsent);
  // as it was when its power came on
  CHECK(bench.drive.control_mode() == cansimple::kPositionControl);
  bench.Run(2);
  CHECK(bench.Reason() == "it answers, but sends no heartbeat");
  CHECK_FALSE(bench.drive.armed());
}

TEST_CASE("whatever the torque, the setpoint is one that a drive can obey") {
  Bench bench;
  const auto text = [&](double torque) { return ToText(bench.motor->Torque(torque)); };
  using Limits = std::numeric_limits<double>;
  CHECK(text(1.5) == "02E#0000C03F");
  CHECK(bench.motor->saturations() == 0);
  CHECK(text(Limits::quiet_NaN()) == "02E#00000000");
  CHECK(text(Limits::infinity()) == "02E#00000000");
  CHECK(text(-Limits::infinity()) == "02E#00000000");
  CHECK(text(1e300) == "02E#FFFF7F7F");  // the largest finite binary32
  CHECK(text(-1e300) == "02E#FFFF7FFF");
  CHECK(bench.motor->saturations() == 5);
}

TEST_CASE("a fault is asked about") {
  Bench bench;
  bench.Run(100);
  CHECK(bench.Arm());
  bench.drive.OnFrame(*FrameFromText("022#"), bench.now);
  bench.Run(40);
  CHECK(bench.motor->state() == DriveState::kFault);
  CHECK_THAT(bench.Reason(), Contains("estop requested"));
}

}  // namespace
}  // namespace plumb
