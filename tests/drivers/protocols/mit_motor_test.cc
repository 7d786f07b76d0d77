// The host's side of the MIT protocol against the virtual motor, in virtual time.

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "drivers/protocols/registry.h"
#include "tests/drivers/protocols/mit_motor_bench.h"

namespace plumb {
namespace {

using Catch::Contains;

using Bench = MitMotorBench;

TEST_CASE("a MIT motor at rest is heard, told to exit, and polled with zeros") {
  Bench bench;
  CHECK(bench.motor->state() == DriveState::kIdle);
  CHECK(bench.motor->confirmed_idle());
  CHECK(bench.Count(Bench::Special(mit::kExit)) >= 2);
  CHECK(bench.Count(Bench::Special(mit::kEnter)) == 0);
  CHECK(bench.motor->estimate().position == Approx(1).margin(1e-3));
  bench.sent.clear();
  bench.Run(5);
  REQUIRE(bench.sent.size() == 5);
  for (const Frame& frame : bench.sent) CHECK(ToText(frame) == "011#7FFF7FF0000007FF");
  CHECK(bench.motor->readings().motor_temperature == 25);
  CHECK(std::isnan(bench.motor->readings().bus_voltage));
}

TEST_CASE("replies of all three kinds are understood") {
  const uint8_t length = GENERATE(6, 7, 8);
  Bench bench(length);
  bench.torque = 1.5;
  CHECK(bench.Arm());
  bench.sample.velocity = -3.25;
  bench.Run(20);
  CHECK(bench.motor->estimate().velocity == Approx(-3.25).margin(0.03));
  CHECK(bench.motor->estimate().position == Approx(bench.sample.position).margin(1e-3));
  CHECK(bench.motor->torque_estimate() == Approx(1.5).margin(0.01));
  CHECK(std::isnan(bench.motor->readings().bus_voltage) == (length != 7));
}

TEST_CASE("arming: zeros, enter, an answer, and only then torque") {
  Bench bench;
  bench.torque = 2;
  bench.sent.clear();
  CHECK(bench.Arm());
  CHECK(bench.device.armed());
  CHECK(bench.Count(Bench::Special(mit::kEnter)) == 2);
  int zeros = 0;
  for (const Frame& frame : bench.sent) {
    if (SameOnWire(frame, Bench::Special(mit::kEnter))) break;
    CHECK(ToText(frame) == "011#7FFF7FF0000007FF");
    ++zeros;
  }
  CHECK(zeros >= 3);
  bench.Run(5);
  CHECK(bench.device.Torque(bench.sample) == Approx(2).margin(0.01));
  bench.motor->Disarm(bench.now);
  bench.Run(60);
  CHECK_FALSE(bench.device.armed());
  CHECK(bench.motor->state() == DriveState::kIdle);
  CHECK(bench.motor->confirmed_idle());
  CHECK(bench.device.zeroed() == 0);
  CHECK(bench.Count(Bench::Special(mit::kZero)) == 0);
}

TEST_CASE("no kick: what a motor was told before it was switched on is not obeyed") {
  Bench bench;
  // Another master's last words, to a motor at rest: it would obey them on "enter".
  bench.device.OnFrame(
      mit::MakeCommand(mit::CommandLayout(kAk80), 0x11, {.position = 5, .kp = 500}), bench.now);
  CHECK(bench.device.Torque(bench.sample) == 0);
  bench.applied = 0;
  CHECK(bench.Arm());
  bench.Run(30);
  CHECK(bench.applied < 0.005);  // the code next to 0

  MitDevice other({.node = 0x11, .master = 0x10, .ranges = kAk80});
  other.OnFrame(mit::MakeCommand(mit::CommandLayout(kAk80), 0x11, {.position = 5, .kp = 500}), 0);
  other.OnFrame(Bench::Special(mit::kEnter), 0);
  CHECK(other.Torque({}) == 18);  // the trap is there
}

TEST_CASE("the motor's watchdog takes the torque away and leaves it switched on") {
  Bench bench;
  bench.torque = 3;
  CHECK(bench.Arm());
  bench.Run(5);
  bench.setpoints = false;
  bench.Run(23);
  CHECK(bench.device.Torque(bench.sample) == Approx(3).margin(0.01));
  bench.Run(3);
  CHECK(bench.device.Torque(bench.sample) == 0);
  CHECK(bench.device.armed());
  FrameBatch out;
  bench.device.OnFrame(Bench::Special(mit::kEnter), bench.now);  // not a command: no food
  CHECK(bench.device.Torque(bench.sample) == 0);
  // Without torque frames there are no replies: the motor counts as absent, and "exit" is tried on.
  bench.Run(300);
  CHECK_FALSE(bench.device.armed());
  CHECK_THAT(std::string(bench.motor->reason()), Contains("no answer for"));
}

TEST_CASE("an error in a reply is a fault, and keeps the motor from being armed") {
  Bench bench;
  CHECK(bench.Arm());
  bench.device.set_error(mit::kOverTemperature);
  bench.Run(2);
  CHECK(bench.motor->state() == DriveState::kFault);
  CHECK(bench.motor->reason() == "the motor reports over-temperature (error 1)");
  CHECK_FALSE(bench.Arm());
  CHECK(bench.motor->state() == DriveState::kFault);
  CHECK(bench.Count(Bench::Special(mit::kEnter)) == 2);  // those of the first time
}

TEST_CASE("an error that a stranger reports does not stay") {
  Bench bench(mit::kWithVoltage);  // such replies have no errors
  REQUIRE(bench.Arm());
  bench.motor->OnFrame(*FrameFromText("010#118A3D7FF7FF1903"), bench.now);
  CHECK_THAT(std::string(bench.motor->reason()), Contains("over-voltage"));
  bench.Run(100);
  CHECK(bench.motor->confirmed_idle());
  CHECK(bench.Arm());
}

TEST_CASE("the position is unwrapped over many turns, both ways") {
  Bench bench;
  for (const double velocity : {40.0, -45.0}) {
    bench.sample.velocity = velocity;
    bench.Run(3000);
    CHECK(bench.motor->estimate().position == Approx(bench.sample.position).margin(2e-3));
  }
  CHECK(bench.sample.position < -13);
}

TEST_CASE("a restart, seen by its position, is a fault") {
  Bench bench;
  CHECK(bench.Arm());
  bench.sample.position = 4;
  bench.Run(2);
  CHECK(bench.motor->state() == DriveState::kFault);
  CHECK_THAT(std::string(bench.motor->reason()), Contains("jumped by 3 rad"));
  bench.Run(60);
  CHECK_FALSE(bench.device.armed());
}

TEST_CASE("where a virtual robot is placed its turns begin anew") {
  Bench bench;
  bench.sample.velocity = 40;
  bench.Run(500);  // beyond what a reply can say
  REQUIRE(bench.motor->estimate().position > 13);
  bench.sample.velocity = 0, bench.sample.position = 1;
  bench.motor->Displaced();
  bench.Run(10);
  CHECK(bench.motor->estimate().position == Approx(1).margin(2e-3));
  CHECK_FALSE(bench.motor->lost_place());
}

TEST_CASE("turns survive a silence only where the motor has not moved meanwhile") {
  Bench bench;
  bench.sample.velocity = 40;
  bench.Run(500);  // beyond what a reply can say
  bench.sample.velocity = 0;
  bench.Run(10);
  const double before = bench.motor->estimate().position;
  REQUIRE(before > 13);
  bench.to_device = [](const Frame&) { return false; };
  bench.Run(300);
  bench.to_device = nullptr;
  SECTION("it has not") {
    bench.Run(60);
    CHECK(bench.motor->estimate().position == Approx(before).margin(2e-3));
    CHECK_FALSE(bench.motor->lost_place());
  }
  SECTION("it has, or counts from elsewhere") {
    bench.sample.position -= 0.7;
    bench.Run(60);
    CHECK(bench.motor->lost_place());
    CHECK_THAT(std::string(bench.motor->reason()), Contains("lost its place"));
  }
}

TEST_CASE("a motor that has had no power for a moment has lost its place") {
  const int silence = GENERATE(110, 150, 190);  // [ms]; of 200 it counts as absent
  Bench bench;
  bench.Run(50);
  bench.to_device = [](const Frame&) { return false; };
  bench.Run(silence);
  bench.to_device = nullptr;
  bench.sample.position += 1.047;  // a turn of the rotor, behind a gear of six
  bench.Run(60);
  CHECK(bench.motor->lost_place());
}

TEST_CASE("nothing but finite torques within the range is sent, and the others are counted") {
  Bench bench;
  CHECK(bench.Arm());
  const std::string most =
      ToText(mit::MakeCommand(mit::CommandLayout(kAk80), 0x11, {.torque = 18}));
  CHECK(ToText(bench.motor->Torque(18)) == most);
  CHECK(bench.motor->saturations() == 0);
  CHECK(ToText(bench.motor->Torque(99)) == most);
  CHECK(ToText(bench.motor->Torque(-99)) == "011#7FFF7FF000000000");
  CHECK(ToText(bench.motor->Torque(std::numeric_limits<double>::quiet_NaN())) ==
        "011#7FFF7FF0000007FF");
  CHECK(ToText(bench.motor->Torque(std::numeric_limits<double>::infinity())) ==
        "011#7FFF7FF0000007FF");
  CHECK(bench.motor->saturations() == 4);
}

TEST_CASE("a lost enter does not spoil arming") {
  Bench bench;
  int seen = 0;
  bench.to_device = [&](const Frame& frame) {
    return !SameOnWire(frame, Bench::Special(mit::kEnter)) || ++seen > 1;
  };
  CHECK(bench.Arm());
  CHECK(bench.device.armed());
}

TEST_CASE("a motor whose position keeps jumping is told to exit, and believed") {
  Bench bench;
  REQUIRE(bench.Arm());
  bench.sample.velocity = 600;  // twelve times what its range says
  bench.Run(100);
  CHECK(bench.motor->state() == DriveState::kFault);
  CHECK_THAT(std::string(bench.motor->reason()), Contains("its position jumped"));
  CHECK_FALSE(bench.device.armed());
  CHECK(bench.motor->confirmed_idle());
  bench.motor->Estop(bench.now);
  const int exits = bench.Count(Bench::Special(mit::kExit));
  bench.Run(100);
  CHECK(bench.Count(Bench::Special(mit::kExit)) >= exits + 2);
  CHECK(bench.motor->confirmed_idle());
}

TEST_CASE("frames of other motors and other kinds are not mine, others are rejected") {
  Bench bench;
  const auto use = [&](const char* text) {
    return bench.motor->OnFrame(*FrameFromText(text), bench.now);
  };
  const MotorEstimate before = bench.motor->estimate();
  CHECK(use("010#127FFF7FF7FF") == FrameUse::kNotMine);  // motor 0x12
  CHECK(use("011#117FFF7FF7FF") == FrameUse::kNotMine);  // another id
  CHECK(use("00000010#117FFF7FF7FF") == FrameUse::kNotMine);
  CHECK(use("010#R6") == FrameUse::kNotMine);
  CHECK(use("010##0117FFF7FF7FF") == FrameUse::kNotMine);
  CHECK(use("010#") == FrameUse::kNotMine);
  CHECK(use("010#117FFF7FF7") == FrameUse::kRejected);
  CHECK(bench.motor->estimate().position == before.position);
  CHECK(use("010#1187AD77A8AA") == FrameUse::kEstimate);
}

TEST_CASE("motors that cannot be") {
  CHECK_THROWS_AS(MakeMitMotor(Bench::Describe(0), {1}), std::invalid_argument);
  CHECK_THROWS_AS(MakeMitMotor(Bench::Describe(0x100), {1}), std::invalid_argument);
  CHECK_THROWS_AS(MakeMitMotor(Bench::Describe(1, 1), {1}), std::invalid_argument);
  MotorDescription description = Bench::Describe();
  description.mit->ranges.torque = 0;
  CHECK_THROWS_AS(MakeMitMotor(description, {1}), std::invalid_argument);
  description.mit.reset();
  CHECK_THROWS_AS(MakeMitMotor(description, {1}), std::invalid_argument);
  CHECK(MakeMotor(Bench::Describe(), {1}) != nullptr);
  MitDevice::Settings settings;
  CHECK_THROWS_AS(MitDevice(settings), std::invalid_argument);  // no ranges
}

}  // namespace
}  // namespace plumb
