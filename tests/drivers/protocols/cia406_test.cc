#include "drivers/protocols/cia406.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "drivers/protocols/cia406_device.h"
#include "drivers/protocols/cia406_host.h"
#include "drivers/protocols/registry.h"

namespace plumb {
namespace {

using namespace cia406;
using Catch::Contains;

constexpr double kTurn = 2 * std::numbers::pi;

// Written by hand from the profile and makers' manuals.
TEST_CASE("CANopen messages have the documented bytes") {
  CHECK(ToText(Make(kNmt, 1, {kStart, 1})) == "000#0101");
  CHECK(ToText(Make(kNmt, 1, {kStart, 0})) == "000#0100");
  CHECK(ToText(Make(kNmt, 5, {kPreOperational, 5})) == "000#8005");
  CHECK(ToText(Make(kHeartbeat, 1, {kBootUp})) == "701#00");
  CHECK(ToText(Make(kHeartbeat, 1, {kOperational})) == "701#05");
  CHECK(ToText(Make(kHeartbeat, 2, {kInPreOperational})) == "702#7F");
  CHECK(ToText(Make(kPosition, 1, {123456})) == "181#40E20100");
  CHECK(ToText(Make(kPosition, 2, {4294967295.})) == "182#FFFFFFFF");
  CHECK(ToText(Make(kSdoRequest, 1, {kWrite2, kPdoParameter, kEventTimer, 2})) ==
        "601#2B00180502000000");
  CHECK(ToText(Make(kSdoRequest, 1, {kWrite4, kPreset, 0, 0})) == "601#2303600000000000");
  CHECK(ToText(Make(kSdoAnswer, 1, {kWritten, kPdoParameter, kEventTimer, 0})) ==
        "581#6000180500000000");
  CHECK(ToText(Make(kEmergency, 1, {0x5000, 1, 0})) == "081#0050010000000000");
  const auto position = DecodePayload(kPosition, *FrameFromText("181#40E20100"));
  REQUIRE(position);
  CHECK((*position)[0] == 123456);
  CHECK(123456 / 65536. * kTurn - kTurn == Approx(5.55301));  // 16 bit per turn
  CHECK_FALSE(DecodePayload(kPosition, *FrameFromText("181#40E201")));
}

SensorDescription Describe(double counts = 65536, double range = 65536) {
  SensorDescription d;
  d.name = "boom";
  d.protocol = "cia406";
  d.node = 1;
  d.counts = counts;
  d.range = range;
  d.period = 0.002;
  d.max_speed = 20;
  return d;
}

/// Driver's side and encoder, a millisecond at a time.
struct Bench {
  explicit Bench(Cia406Device::Settings settings = {}, SensorDescription d = Describe())
      : sensor(MakeSensor(d, {250'000})), device(settings, now) {}
  void Step() {
    now += 1000;
    position += velocity * 1e-3;
    FrameBatch out, in;
    sensor->Tick(now, out);
    for (const Frame& frame : out.frames()) {
      sent.push_back(ToText(frame));
      device.OnFrame(frame, now);
    }
    device.Tick(now, position, in);
    for (const Frame& frame : in.frames()) {
      if (!tap || tap(frame)) readings += sensor->OnFrame(frame, now) == SensorUse::kReading;
    }
  }
  void Run(int milliseconds) {
    for (int i = 0; i < milliseconds; ++i) Step();
  }
  std::string Reason() const { return std::string(sensor->reason()); }

  int64_t now = 1'000'000;
  std::unique_ptr<Sensor> sensor;
  Cia406Device device;
  double position = 0.5, velocity = 0;
  int readings = 0;
  std::vector<std::string> sent;
  std::function<bool(const Frame&)> tap;
};

TEST_CASE("an encoder is told its period and to start, and then read") {
  Bench bench;
  CHECK(bench.sensor->state() == SensorState::kAbsent);
  CHECK(bench.sensor->reason() == "not heard yet");
  bench.Run(1);
  CHECK(bench.sent == std::vector<std::string>{"601#2B00180502000000", "000#0101"});
  bench.Run(100);
  // Once more when its boot-up message came, which may be later than what we said.
  CHECK(bench.sent.size() == 4);
  CHECK(bench.sensor->state() == SensorState::kRunning);
  CHECK(bench.readings >= 49);
  CHECK(bench.sensor->encoder()->position == Approx(0.5).margin(1e-4));
  CHECK(std::isnan(bench.sensor->encoder()->velocity));
  CHECK(bench.sensor->imu() == nullptr);
}

TEST_CASE("one that sends too seldom is told its period until it says that it has it") {
  // Somebody has given it 50 ms, or so long that it seems to have fallen silent, and stopped it: it
  // starts when it is told to, but does not hear its period before.
  const auto [request, range] = GENERATE(table<const char*, double>(
      {{"601#2B00180532000000", 65536}, {"601#2B0018052C010000", 4294967296.}}));
  Bench bench({.range = range}, Describe(65536, range));
  bench.device.OnFrame(*FrameFromText(request), bench.now);
  bench.device.OnFrame(*FrameFromText("000#0201"), bench.now);
  bench.tap = [](const Frame& frame) { return frame.id != 0x701 && frame.id != 0x581; };
  bench.Run(1);
  bench.tap = nullptr;
  bench.Run(700);
  CHECK(bench.sensor->state() == SensorState::kRunning);
  bench.readings = 0;
  bench.sent.clear();
  bench.Run(1000);
  CHECK(bench.readings == 500);
  CHECK(bench.sent.empty());
}

TEST_CASE("one that was there before, and one that comes later") {
  Bench bench;
  bench.tap = [](const Frame&) { return false; };
  bench.Run(700);
  CHECK(bench.sent.size() == 4);
  CHECK(bench.sensor->state() == SensorState::kAbsent);
  bench.tap = nullptr;
  bench.sent.clear();
  bench.Run(10);
  CHECK(bench.sensor->state() == SensorState::kRunning);
}

TEST_CASE("turns are counted, both ways, on single-turn and multi-turn encoders") {
  const double range = GENERATE(65536., 65536. * 4096, 4294967296., 100000.);
  Bench bench({.range = range}, Describe(65536, range));
  bench.Run(20);
  for (const double velocity : {15.0, -19.0}) {
    const double start = bench.position;
    const double read = bench.sensor->encoder()->position;
    bench.velocity = velocity;
    bench.Run(4000);
    bench.velocity = 0;
    bench.Run(4);
    CHECK(bench.sensor->state() == SensorState::kRunning);
    CHECK(bench.sensor->encoder()->position - read == Approx(bench.position - start).margin(3e-4));
  }
}

TEST_CASE("a jump is a fault, not motion; Start leads out of it") {
  Bench bench;
  bench.Run(50);
  const double before = bench.sensor->encoder()->position;
  bench.position += 0.1;  // 50 rad/s
  bench.Run(4);
  CHECK(bench.sensor->state() == SensorState::kFault);
  CHECK_THAT(bench.Reason(), Contains("jumped by 104") && Contains("more than 20 rad/s"));
  CHECK(bench.sensor->encoder()->position == before);
  bench.Run(100);
  CHECK(bench.sensor->state() == SensorState::kFault);
  bench.sensor->Start(bench.now);
  bench.Run(4);
  CHECK(bench.sensor->state() == SensorState::kRunning);
  CHECK(bench.sensor->encoder()->position == Approx(0.6).margin(1e-4));
}

TEST_CASE("after Start turns are counted anew, from wherever it is") {
  Bench bench;
  bench.Run(50);
  bench.tap = [](const Frame&) { return false; };
  bench.position += 3;  // by hand, while nobody listened
  bench.Run(10);
  bench.tap = nullptr;
  bench.sensor->Start(bench.now);
  bench.Run(50);
  CHECK(bench.sensor->state() == SensorState::kRunning);
  CHECK(bench.sensor->encoder()->position == Approx(3.5 - 2 * std::numbers::pi).margin(1e-4));
}

TEST_CASE("lost and late positions are no jumps") {
  Bench bench;
  bench.velocity = 19;
  int count = 0;
  bench.tap = [&](const Frame& frame) { return frame.id != 0x181 || ++count % 5 == 0; };
  bench.Run(1000);
  CHECK(bench.sensor->state() == SensorState::kRunning);
}

TEST_CASE("silence is absence; how far it may have turned meanwhile decides what comes after") {
  Bench bench;
  bench.Run(50);
  bench.tap = [](const Frame&) { return false; };
  SECTION("long: anywhere") {
    bench.Run(300);
    CHECK(bench.sensor->state() == SensorState::kAbsent);
    CHECK(bench.Reason() == "not heard any more");
    bench.tap = nullptr;
    bench.Run(4);
    CHECK(bench.sensor->state() == SensorState::kFault);
    CHECK_THAT(bench.Reason(), Contains("turned anywhere"));
  }
  SECTION("short: it is known") {
    bench.velocity = 10;
    bench.Run(100);
    bench.tap = nullptr;
    bench.Run(4);
    CHECK(bench.sensor->state() == SensorState::kRunning);
    CHECK(bench.sensor->encoder()->position == Approx(bench.position).margin(0.03));
  }
}

TEST_CASE("heartbeats without positions are a fault") {
  Bench bench;
  bench.Run(50);
  bench.tap = [](const Frame& frame) { return frame.id != 0x181; };
  bench.Run(260);
  CHECK(bench.sensor->state() == SensorState::kFault);
  CHECK_THAT(bench.Reason(), Contains("has sent no position for 25"));
}

TEST_CASE("a restart, a stop and an emergency are faults") {
  Bench bench;
  bench.Run(50);
  SECTION("restart") {
    bench.device.Reboot(bench.now);
    bench.Run(1);
    CHECK(bench.Reason() == "it has restarted");
    bench.sensor->Start(bench.now);
    bench.Run(10);
    CHECK(bench.sensor->state() == SensorState::kRunning);
  }
  SECTION("somebody stops it") {
    bench.device.OnFrame(*FrameFromText("000#0200"), bench.now);
    bench.Run(110);
    CHECK(bench.Reason() == "it went to NMT state 0x04");
  }
  SECTION("emergency") {
    bench.device.Emergency(0x5000);
    bench.Run(1);
    CHECK(bench.Reason() == "it reports error 0x5000 (register 0x01)");
    bench.device.Emergency(0);  // error reset: the fault stays
    bench.Run(1);
    CHECK(bench.sensor->state() == SensorState::kFault);
    CHECK(bench.Reason() == "it reports error 0x5000 (register 0x01)");
  }
  CHECK((bench.sensor->state() == SensorState::kFault ||
         bench.sensor->state() == SensorState::kRunning));
}

TEST_CASE("a period that it refuses is a fault") {
  Bench bench({.refuses_timer = true});
  bench.Run(3);
  CHECK(bench.sensor->state() == SensorState::kFault);
  CHECK_THAT(bench.Reason(), Contains("refuses to send every 2 ms (SDO abort 0x06090030)"));
}

TEST_CASE("what an encoder's frames must be") {
  Bench bench({}, Describe(65536, 65536));
  const auto use = [&](const char* text) {
    return bench.sensor->OnFrame(*FrameFromText(text), bench.now);
  };
  CHECK(use("182#00000000") == SensorUse::kNotMine);
  CHECK(use("00000181#00000000") == SensorUse::kNotMine);
  CHECK(use("181#R4") == SensorUse::kNotMine);
  CHECK(use("181##000000000") == SensorUse::kNotMine);
  CHECK(use("181#000000") == SensorUse::kRejected);
  CHECK(use("181#00000100") == SensorUse::kRejected);  // beyond its range
  CHECK(use("701#") == SensorUse::kRejected);
  CHECK(use("081#0000") == SensorUse::kRejected);
  CHECK(use("581#00") == SensorUse::kRejected);
  CHECK(use("181#FFFF0000") == SensorUse::kReading);
  CHECK(use("181#FFFF000000000000") == SensorUse::kReading);  // other objects behind it
}

TEST_CASE("encoders that cannot be") {
  SensorDescription d = Describe();
  d.node = 0;
  CHECK_THROWS_AS(MakeSensor(d, {1}), std::invalid_argument);
  d = Describe();
  d.counts = 0;
  CHECK_THROWS_AS(MakeSensor(d, {1}), std::invalid_argument);
  CHECK_THROWS_AS(MakeSensor(Describe(), {0}), std::invalid_argument);
  d.protocol = "nonsense";
  CHECK_THROWS_WITH(MakeSensor(d, {1}), Contains("cia406, xsens"));
  CHECK_THROWS_AS(Cia406Device({.node = 128}, 0), std::invalid_argument);
}

}  // namespace
}  // namespace plumb
