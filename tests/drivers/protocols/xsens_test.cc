#include "drivers/protocols/xsens.h"

#include <fmt/format.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "drivers/protocols/registry.h"
#include "drivers/protocols/xsens_device.h"
#include "drivers/protocols/xsens_host.h"

namespace plumb {
namespace {

using namespace xsens;
using Catch::Contains;

// Written by hand from Movella's page.
struct Row {
  const Layout* layout;
  std::vector<double> values;
  const char* text;
};
const double kHalf = std::numbers::pi / 12;  // half of 30 degrees
const Row kRows[] = {
    {&kRateOfTurn, {0.1, -0.25, 2.5}, "032#0033FF800500"},
    {&kAcceleration, {1.5, -2.25, 9.80859}, "034#0180FDC009CF"},
    {&kQuaternion, {std::cos(kHalf), 0, std::sin(kHalf), 0}, "021#7BA2000021210000"},
    {&kQuaternion, {1, 0, 0, 0}, "021#7FFF000000000000"},
    {&kEulerAngles, {12.5, -3.25, -90}, "022#0640FE60D300"},
    {&kSampleTime, {123456}, "005#0001E240"},
    {&kGroupCounter, {0x1234}, "006#1234"},
    {&kStatusWord, {0x00800043}, "011#00800043"},
    {&kError, {1}, "001#01"},
};

TEST_CASE("Xsens messages have the documented bytes, both ways") {
  for (const Row& row : kRows) {
    INFO(row.text);
    CHECK(row.layout->count() == row.values.size());
    const std::vector<double>& v = row.values;
    const Frame frame = v.size() == 4   ? Make(*row.layout, 0, {v[0], v[1], v[2], v[3]})
                        : v.size() == 3 ? Make(*row.layout, 0, {v[0], v[1], v[2]})
                                        : Make(*row.layout, 0, {v[0]});
    CHECK(ToText(frame) == row.text);
    const auto values = DecodePayload(*row.layout, *FrameFromText(row.text));
    REQUIRE(values);
    for (size_t i = 0; i < v.size(); ++i)
      CHECK(std::abs((*values)[i] - v[i]) <= 0.5 * row.layout->fields[i].scale);
  }
  const auto swapped = DecodePayload(kAcceleration, *FrameFromText("034#00000000CF09"));
  REQUIRE(swapped);
  CHECK((*swapped)[2] == Approx(-48.964844));
  CHECK_FALSE(DecodePayload(kAcceleration, *FrameFromText("034#0180FDC009")));
}

TEST_CASE("every code of every fixed-point field survives") {
  for (const Layout* layout : {&kRateOfTurn, &kAcceleration, &kQuaternion, &kEulerAngles}) {
    const Field& field = layout->fields[1];
    for (int code = -32768; code <= 32767; ++code) {
      const double value = code * field.scale;
      if (field.Decode(field.Encode(value)) != value) FAIL(layout->name << " " << code);
    }
  }
}

SensorDescription Describe() {
  SensorDescription d;
  d.name = "imu";
  d.protocol = "xsens";
  d.base = 0x380;
  d.period = 0.005;
  return d;
}

struct Bench {
  explicit Bench(XsensDevice::Settings settings = {.base = 0x380}) : device(settings, now) {}
  void Step() {
    now += 1000;
    FrameBatch out, in;
    sensor->Tick(now, out);
    CHECK(out.size() == 0);
    // Tells samples apart: all three parts say the same number.
    ++number;
    const double q = 1e-3 * (number % 500);
    sample.rate = {number % 500 * 0.01, 0, 0};
    sample.force = {number % 500 * 0.01, 0, 9.81};
    sample.orientation = {std::sqrt(1 - q * q), q, 0, 0};
    device.Tick(now, sample, in);
    for (const Frame& frame : in.frames()) {
      if (tap && !tap(frame)) continue;
      if (sensor->OnFrame(frame, now) != SensorUse::kReading) continue;
      ++readings;
      const ImuSample& got = *sensor->imu();
      if (std::abs(got.rate[0] - got.force[0]) > 0.005 ||
          std::abs(got.rate[0] - got.orientation[1] * 10) > 0.005)
        ++mixed;
    }
  }
  void Run(int milliseconds) {
    for (int i = 0; i < milliseconds; ++i) Step();
  }
  std::string Reason() const { return std::string(sensor->reason()); }

  int64_t now = 1'000'000;
  std::unique_ptr<Sensor> sensor = MakeSensor(Describe(), {100'000});
  XsensDevice device;
  XsensDevice::Sample sample;
  int number = 0, readings = 0, mixed = 0;
  std::function<bool(const Frame&)> tap;
};

TEST_CASE("samples are given out when they are complete") {
  const bool counter = GENERATE(false, true);
  Bench bench({.base = 0x380, .group_counter = counter});
  CHECK(bench.sensor->state() == SensorState::kAbsent);
  bench.Run(1000);
  CHECK(bench.sensor->state() == SensorState::kRunning);
  CHECK(bench.readings == 200);
  CHECK(bench.mixed == 0);
  CHECK(bench.sensor->incomplete() == 0);
  const ImuSample& got = *bench.sensor->imu();
  CHECK(got.force[2] == Approx(9.81).margin(0.002));
  CHECK(got.orientation_valid);
  CHECK_FALSE(got.rate_clipped);
  CHECK_FALSE(got.force_clipped);
  CHECK(got.sample_time == 199 * 5000);
  CHECK(bench.sensor->encoder() == nullptr);
}

TEST_CASE("SampleTime goes round") {
  Bench bench({.base = 0x380, .first_tick = 0xFFFFFFFF - 500});
  bench.Run(1000);
  CHECK(bench.sensor->state() == SensorState::kRunning);
  CHECK(bench.sensor->imu()->sample_time == 199 * 5000);
}

TEST_CASE("any lost frame loses its sample, and no two are mixed") {
  const uint32_t lost = GENERATE(0x385u, 0x391u, 0x3A1u, 0x3B2u, 0x3B4u);
  Bench bench;
  int count = 0;
  bench.tap = [&](const Frame& frame) { return frame.id != lost || ++count % 3 != 0; };
  bench.Run(1500);
  CHECK(bench.mixed == 0);
  CHECK(bench.readings == 200);
  if (lost != 0x385) CHECK(bench.sensor->incomplete() >= 99);
}

TEST_CASE("frames lost at random") {
  Bench bench;
  uint32_t random = 1;
  bench.tap = [&](const Frame&) {
    random = random * 1664525 + 1013904223;
    return random >> 24 >= 64;  // one in four is lost
  };
  bench.Run(20'000);
  CHECK(bench.mixed == 0);
  CHECK(bench.readings > 500);
  CHECK(bench.sensor->incomplete() > 1000);
}

TEST_CASE("parts that come too late are not of this sample") {
  Bench bench;
  const auto use = [&](const char* text) {
    return bench.sensor->OnFrame(*FrameFromText(text), bench.now);
  };
  for (const char* text :
       {"385#00000001", "391#00000002", "3A1#7FFF000000000000", "3B2#000000000000"}) {
    CHECK(use(text) == SensorUse::kConsumed);
  }
  bench.now += 6000;
  CHECK(use("3B4#000000000000") == SensorUse::kConsumed);
  CHECK(bench.sensor->incomplete() == 1);
}

TEST_CASE("the status word says what a sample is worth") {
  Bench bench;
  bench.sample.status = 0;
  bench.Run(10);
  CHECK_FALSE(bench.sensor->imu()->orientation_valid);
  bench.sample.status = kOrientationValid | 1u << 12;
  bench.Run(10);
  CHECK(bench.sensor->imu()->orientation_valid);
  CHECK(bench.sensor->imu()->rate_clipped);
  CHECK_FALSE(bench.sensor->imu()->force_clipped);
  bench.sample.status = kOrientationValid | kClippingDetected;  // and nobody says of what
  bench.Run(10);
  CHECK(bench.sensor->imu()->rate_clipped);
  CHECK(bench.sensor->imu()->force_clipped);
  bench.sample.status = kOrientationValid | kClippingDetected | 1u << 15;  // the magnetometer
  bench.Run(10);
  CHECK_FALSE(bench.sensor->imu()->rate_clipped);
  CHECK_FALSE(bench.sensor->imu()->force_clipped);
  bench.sample.status = kOrientationValid | kClippingDetected | 1u << 9;
  bench.Run(10);
  CHECK_FALSE(bench.sensor->imu()->rate_clipped);
  CHECK(bench.sensor->imu()->force_clipped);
  const auto use = [&](const char* text) {
    return bench.sensor->OnFrame(*FrameFromText(text), bench.now);
  };
  for (const char* text :
       {"385#7F000001", "391#00000002", "3A1#0000000000000000", "3B2#000000000000"})
    use(text);
  CHECK(use("3B4#000000000000") == SensorUse::kReading);
  CHECK_FALSE(bench.sensor->imu()->orientation_valid);  // no unit quaternion
}

TEST_CASE("what is beyond a message's range is known to be") {
  Bench bench;
  std::string status;
  XsensDevice device({.base = 0x380}, 0);
  FrameBatch out;
  device.Tick(5000, {.rate = {0, -70, 0}, .force = {130, 0, -150}}, out);
  for (const Frame& frame : out.frames()) {
    bench.sensor->OnFrame(frame, bench.now);
    if (frame.id == 0x391) status = ToText(frame);
  }
  // orientation valid; accelerometer x and z, gyroscope y
  CHECK(status == "391#00001502");
  CHECK(bench.sensor->imu()->rate_clipped);
  CHECK(bench.sensor->imu()->force_clipped);
  CHECK(bench.sensor->imu()->force[0] == Approx(128).margin(0.01));
  CHECK(bench.sensor->imu()->force[2] == -128);

  uint32_t tick = 100;
  const auto clipped = [&](const std::string& rate, const std::string& force) {
    for (const std::string& text :
         {fmt::format("385#{:08X}", tick += 50), std::string("391#00000002"),
          std::string("3A1#7FFF000000000000"), "3B2#" + rate, "3B4#" + force})
      bench.sensor->OnFrame(*FrameFromText(text), bench.now);
    const ImuSample& got = *bench.sensor->imu();
    return std::string(got.rate_clipped ? "rate" : "") + (got.force_clipped ? "force" : "");
  };
  CHECK(clipped("000000000000", "000000007FFE").empty());
  CHECK(clipped("000000000000", "000000007FFF") == "force");  // whatever the status word says
  CHECK(clipped("000000000000", "800000000000") == "force");
  CHECK(clipped("00007FFF0000", "000000000000") == "rate");
  CHECK(clipped("000080010000", "000000000000").empty());
}

TEST_CASE("a restart and an error are faults, silence is absence, missing messages are named") {
  Bench bench;
  bench.Run(100);
  SECTION("restart") {
    bench.device.Reboot(bench.now);
    bench.Run(10);
    CHECK(bench.sensor->state() == SensorState::kFault);
    CHECK_THAT(bench.Reason(), Contains("clock went back"));
    bench.sensor->Start(bench.now);
    bench.Run(10);
    CHECK(bench.sensor->state() == SensorState::kRunning);
  }
  SECTION("error") {
    bench.device.Error(1);
    bench.Run(10);
    CHECK(bench.Reason() == "it reports error 1");
  }
  SECTION("warning") {
    CHECK(bench.sensor->OnFrame(*FrameFromText("382#01"), bench.now) == SensorUse::kConsumed);
    CHECK(bench.sensor->state() == SensorState::kRunning);
  }
  SECTION("silence") {
    bench.tap = [](const Frame&) { return false; };
    bench.Run(120);
    CHECK(bench.sensor->state() == SensorState::kAbsent);
    CHECK(bench.Reason() == "not heard any more");
  }
  SECTION("no accelerations") {
    bench.tap = [](const Frame& frame) { return frame.id != 0x3B4; };
    bench.Run(120);
    CHECK(bench.sensor->state() == SensorState::kStarting);
    CHECK_THAT(bench.Reason(), Contains("no complete sample"));
  }
}

TEST_CASE("what an IMU's frames must be") {
  Bench bench;
  const auto use = [&](const char* text) {
    return bench.sensor->OnFrame(*FrameFromText(text), bench.now);
  };
  CHECK(use("005#0001E240") == SensorUse::kNotMine);  // the factory's id
  CHECK(use("00000385#0001E240") == SensorUse::kNotMine);
  CHECK(use("385#R4") == SensorUse::kNotMine);
  CHECK(use("3A2#000000000000") == SensorUse::kNotMine);
  CHECK(use("385#0001E2") == SensorUse::kRejected);
  CHECK(use("385#0001E240") == SensorUse::kConsumed);
  CHECK(use("385#0001E240") == SensorUse::kRejected);  // twice the same
  CHECK(use("3B2#0000") == SensorUse::kRejected);
  SensorDescription d = Describe();
  d.base = 0x7FF;
  CHECK_THROWS_AS(MakeSensor(d, {1}), std::invalid_argument);
}

}  // namespace
}  // namespace plumb
