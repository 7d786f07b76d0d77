// The host's side of a moteus against the virtual motor, in virtual time: how it is asked, armed
// and given torques, and whose frames it obeys.

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numbers>

#include "drivers/protocols/registry.h"
#include "tests/drivers/protocols/moteus_motor_bench.h"

namespace plumb {
namespace {

using namespace moteus;
using Bench = MoteusMotorBench;

TEST_CASE("a moteus at rest is heard, and has no commands") {
  Bench bench;
  CHECK(bench.motor->state() == DriveState::kIdle);
  CHECK(bench.motor->confirmed_idle());
  CHECK(bench.Count(MakeStop(Bench::kNode)) >= 2);
  CHECK(std::ranges::none_of(bench.sent, Bench::IsCommand));
  bench.sample.velocity = -3;
  bench.estimates = 0;
  bench.sent.clear();
  bench.Run(100);
  CHECK(bench.estimates == 100);
  CHECK(bench.sent.size() == 100);  // a frame a cycle
  CHECK(bench.motor->estimate().position == Approx(bench.sample.position).epsilon(1e-6));
  CHECK(bench.motor->estimate().velocity == Approx(-3).epsilon(1e-6));
  CHECK(std::isnan(bench.motor->readings().motor_temperature));
  CHECK(bench.motor->readings().drive_temperature == 25);
  CHECK(bench.motor->readings().temperatures_at == bench.now);
  CHECK(bench.motor->readings().bus_voltage == 24);
  bench.device.set_thermistor(61);
  bench.Run(2);
  CHECK(bench.motor->readings().motor_temperature == 61);
  CHECK_FALSE(bench.motor->lost_place());
}

TEST_CASE("arming a moteus: stop, who it is, what it does without commands, zeros, then torque") {
  Bench bench;
  bench.torque = 2;
  bench.sent.clear();
  bench.applied = 0;
  CHECK(bench.Arm());
  CHECK(bench.applied == 0);
  CHECK(bench.device.armed());
  CHECK(bench.motor->identity() == "moteus, firmware 0.1.7, register map 5");
  const auto first = std::ranges::find_if(bench.sent, Bench::IsCommand);
  const auto stops = std::count_if(bench.sent.begin(), first, [](const Frame& frame) {
    return frame.data[1] == kMode && frame.data[2] == kStopped;
  });
  CHECK(stops == first - bench.sent.begin());
  CHECK(stops >= 4);
  bench.estimates = 0;
  bench.sample.velocity = 12;
  bench.sent.clear();
  bench.Run(50);
  CHECK(bench.estimates == 50);
  CHECK(bench.sent.size() == 50);
  CHECK(bench.device.Torque(bench.sample) == 2);
  CHECK(bench.motor->torque_estimate() == 2);
  CHECK(bench.motor->estimate().position == Approx(bench.sample.position).epsilon(1e-6));

  bench.motor->Disarm(bench.now);
  CHECK_FALSE(bench.motor->confirmed_idle());
  bench.Run(10);
  CHECK_FALSE(bench.device.armed());
  CHECK(bench.motor->state() == DriveState::kIdle);
  CHECK(bench.motor->confirmed_idle());
  CHECK(bench.Arm());
}

TEST_CASE("a moteus' gains stay out of it: what is sent is torque alone") {
  Bench bench({.kp = 1000, .kd = 100});
  bench.torque = 0.5;
  REQUIRE(bench.Arm());
  bench.sample.velocity = 50;
  for (int i = 0; i < 100; ++i) {
    bench.Step();
    CHECK(std::abs(bench.device.Torque(bench.sample)) <= 0.5);
  }
}

TEST_CASE("whatever a moteus was told before, it is told to stop") {
  Bench bench;
  const Frame turn = MakeCommand(Bench::kNode, {.torque = 5, .max_torque = 9, .timeout = 32'767});
  bench.device.OnFrame(turn, bench.now);
  bench.Run(40);  // at rest: its answers say that it runs
  CHECK(bench.device.mode() == kStopped);
  CHECK(bench.motor->confirmed_idle());

  bench.device.OnFrame(turn, bench.now);
  // a driver that has just been started
  const auto other = MakeMoteusMotor(Bench::Describe(), {200'000});
  FrameBatch frames;
  other->Tick(bench.now, true, frames);
  CHECK(SameOnWire(frames.frames()[0], MakeStop(Bench::kNode)));
}

TEST_CASE("a moteus gets finite torques within its own, and the others are counted") {
  Bench bench;
  const auto said = [&](double torque) {
    const Frame frame = bench.motor->Torque(torque);
    return Bench::IsCommand(frame) ? (*DecodePayload(kCommand.layout, frame))[3] : -1;
  };
  CHECK(SameOnWire(bench.motor->Torque(9), MakeStop(Bench::kNode)));  // not armed
  CHECK(bench.Arm());
  CHECK(said(9) == 9);
  CHECK(said(-20) == -20);
  CHECK(said(0) == 0);
  CHECK(bench.motor->saturations() == 0);
  CHECK(said(99) == 20);
  CHECK(said(-1e300) == -20);
  CHECK(said(std::numeric_limits<double>::quiet_NaN()) == 0);
  CHECK(said(std::numeric_limits<double>::infinity()) == 0);
  CHECK(bench.motor->saturations() == 4);
}

TEST_CASE("emergency stops of a moteus: ours, and somebody else's") {
  Bench bench;
  CHECK(bench.Arm());
  bench.motor->Estop(bench.now);
  bench.Step();
  CHECK_FALSE(bench.device.armed());
  CHECK(bench.motor->reason() == "emergency stop requested");
  const auto stops = [&](const char* text) { return bench.motor->IsEstop(*FrameFromText(text)); };
  CHECK(stops("00008011##1010000"));
  CHECK(stops("00008511##1010000"));  // another master's
  CHECK(stops("0000807F##1010000"));
  CHECK(stops("011#010000"));
  CHECK_FALSE(stops("00008012##1010000"));
  CHECK_FALSE(stops("00008011##101000A"));
  CHECK_FALSE(stops("00008011##10100"));
  CHECK_FALSE(stops("011#R8"));
}

TEST_CASE("frames of other moteus and other kinds are not mine, others are rejected") {
  Bench bench;
  const auto use = [&](const std::string& text) {
    return bench.motor->OnFrame(*FrameFromText(text), bench.now);
  };
  const std::string answer =
      "2100002F01000000400000000000000000"
      "20060A00000130190029700A000000";
  const MotorEstimate before = bench.motor->estimate();
  CHECK(use("00001200##1" + answer) == FrameUse::kNotMine);
  CHECK(use("00001101##1" + answer) == FrameUse::kNotMine);  // to another master
  CHECK(use("00008011##1" + answer) == FrameUse::kNotMine);
  CHECK(use("00001100#210000") == FrameUse::kNotMine);  // no FD
  CHECK(use("00001100#R8") == FrameUse::kNotMine);
  CHECK(use("00001100##1") == FrameUse::kRejected);
  CHECK(use("00001100##1210000") == FrameUse::kRejected);
  CHECK(use("00001100##131000121") == FrameUse::kRejected);
  CHECK(bench.motor->estimate().position == before.position);
  CHECK(use("00001100##1" + answer) == FrameUse::kEstimate);
  CHECK(bench.motor->estimate().position == Approx(4 * std::numbers::pi));
}

TEST_CASE("a moteus of a small number answers with an id of 11 bits") {
  const auto motor = MakeMoteusMotor(Bench::Describe(7), {200'000});
  CHECK(motor->filter().id == 0x700);
  CHECK_FALSE(motor->filter().extended);
  CHECK(motor->filter().mask == 0x7FF);
  const auto great = MakeMoteusMotor(Bench::Describe(8), {200'000});
  CHECK(great->filter().id == 0x800);
  CHECK(great->filter().extended);
  CHECK(great->filter().mask == 0x1FFFFFFF);
}

TEST_CASE("moteus that cannot be") {
  CHECK_THROWS_AS(MakeMoteusMotor(Bench::Describe(0), {1}), std::invalid_argument);
  CHECK_THROWS_AS(MakeMoteusMotor(Bench::Describe(127), {1}), std::invalid_argument);
  MotorDescription description = Bench::Describe();
  description.moteus->torque = 0;
  CHECK_THROWS_AS(MakeMoteusMotor(description, {1}), std::invalid_argument);
  description.moteus->torque = 1;
  description.moteus->watchdog = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(MakeMoteusMotor(description, {1}), std::invalid_argument);
  description.moteus->watchdog = 33;
  CHECK_THROWS_AS(MakeMoteusMotor(description, {1}), std::invalid_argument);
  description.moteus.reset();
  CHECK_THROWS_AS(MakeMoteusMotor(description, {1}), std::invalid_argument);
  CHECK_THROWS_AS(MakeMoteusDevice(description, {}, {}), std::invalid_argument);
  CHECK(MakeMotor(Bench::Describe(), {1}) != nullptr);
}

}  // namespace
}  // namespace plumb
