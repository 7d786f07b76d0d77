#include "drivers/protocols/mit.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>

#include "drivers/protocols/mit_device.h"

namespace plumb::mit {
namespace {

constexpr MitRanges Ranges(double velocity, double torque) {
  return {.position = 12.5, .velocity = velocity, .torque = torque, .kp = 500, .kd = 5};
}

/// A motor's firmware, its arithmetic written down once more: single precision, truncated.
uint32_t FirmwareCode(float x, float least, float most, int bits) {
  return static_cast<uint32_t>((x - least) * static_cast<float>((1 << bits) - 1) / (most - least));
}

// Commands as a mini-cheetah's own master encodes them, and what is nearest, which is what we send.
// Written by hand from the firmware's source; they share nothing with our tables.
struct Row {
  double velocity, torque;
  Setpoint s;
  const char *truncated, *nearest;
};
const Row kRows[] = {
    {50, 18, {0, 0, 0, 0, 0}, "7FFF7FF0000007FF", "7FFF7FF0000007FF"},
    {50, 18, {1, 0, 50, 1, 0}, "8A3C7FF1993337FF", "8A3D7FF1993337FF"},
    {76, 12, {-1.5, 2, 20, 0.5, 3}, "70A38350A31999FF", "70A38350A41999FF"},
    {50, 18, {-1.5, 2, 20, 0.5, 3}, "70A38510A3199954", "70A38510A4199955"},
    {50, 65, {-1.5, 2, 20, 0.5, 3}, "70A38510A319985E", "70A38510A419985E"},
    {50, 18, {12.5, 0, 500, 5, 0}, "FFFF7FFFFFFFF7FF", "FFFF7FFFFFFFF7FF"},
    {50, 18, {-12.5, -50, 0, 0, -18}, "0000000000000000", "0000000000000000"},
};

TEST_CASE("MIT commands have the documented bytes, both ways") {
  for (const Row& row : kRows) {
    const Layout layout = CommandLayout(Ranges(row.velocity, row.torque));
    INFO(row.truncated);
    CHECK(ToText(MakeCommand(layout, 1, row.s)) == std::string("001#") + row.nearest);
    const auto v = DecodePayload(layout, *FrameFromText(std::string("001#") + row.truncated));
    REQUIRE(v);
    const std::array<double, 5> values = {row.s.position, row.s.velocity, row.s.kp, row.s.kd,
                                          row.s.torque};
    for (size_t i = 0; i < 5; ++i)
      CHECK(std::abs((*v)[i] - values[i]) <= 1.001 * layout.fields[i].scale);
    CHECK(FirmwareCode(float(row.s.position), -12.5f, 12.5f, 16) ==
          std::stoul(std::string(row.truncated).substr(0, 4), nullptr, 16));
  }
}

TEST_CASE("MIT replies have the documented bytes") {
  struct {
    double velocity, torque;
    const char* text;
    double position_got, velocity_got, torque_got;
  } const rows[] = {
      {76, 12, "000#0187AD7A78FF", 0.749790, -3.284982, 1.497436},
      {50, 18, "000#0187AD77A8AA", 0.749790, -3.26007, 1.49890},
      {50, 18, "000#017FFF7FF7FF", -0.000191, -0.0122, -0.0044},
  };
  for (const auto& row : rows) {
    const Layout layout = ReplyLayout(Ranges(row.velocity, row.torque), kPlain);
    const auto v = DecodePayload(layout, *FrameFromText(row.text));
    REQUIRE(v);
    CHECK((*v)[0] == 1);
    CHECK((*v)[1] == Approx(row.position_got).margin(2e-6));
    CHECK((*v)[2] == Approx(row.velocity_got).margin(2e-5));
    CHECK((*v)[3] == Approx(row.torque_got).margin(2e-5));
  }
  const auto voltage = DecodePayload(ReplyLayout(Ranges(50, 18), kWithVoltage),
                                     *FrameFromText("000#017FFF7FF7FF99"));
  REQUIRE(voltage);
  CHECK((*voltage)[4] == Approx(24));
  const auto error = DecodePayload(ReplyLayout(Ranges(50, 18), kWithTemperature),
                                   *FrameFromText("000#017FFF7FF7FFF603"));
  REQUIRE(error);
  CHECK((*error)[4] == -10);
  CHECK((*error)[5] == 3);
  CHECK_FALSE(DecodePayload(ReplyLayout(Ranges(50, 18), kWithTemperature),
                            *FrameFromText("000#017FFF7FF7FF99")));
  CHECK_FALSE(DecodePayload(ReplyLayout(Ranges(50, 18), kPlain), *FrameFromText("000#017FFF7FF7")));
}

TEST_CASE("the virtual motor replies with the firmware's bytes") {
  const auto reply = [](double velocity, double torque, Setpoint s, MitDevice::Sample sample,
                        uint8_t length) {
    MitDevice motor(
        {.node = 1, .master = 0, .ranges = Ranges(velocity, torque), .reply_length = length});
    const Layout layout = CommandLayout(Ranges(velocity, torque));
    FrameBatch out;
    motor.OnFrame(MakeSpecial(1, kEnter), 0);
    motor.OnFrame(MakeCommand(layout, 1, s), 0);
    motor.Tick(0, sample, out);
    out.Clear();
    motor.OnFrame(MakeCommand(layout, 1, {}), 0);
    motor.Tick(0, sample, out);
    REQUIRE(out.size() == 1);
    return ToText(out.frames()[0]);
  };
  // 1.5 Nm have no code: the nearest is a little more, which truncation turns into the code itself
  // or the one before.
  CHECK(reply(76, 12, {.torque = 1.5}, {0.75, -3.25}, 6).substr(0, 13) == "000#0187AD7A7");
  CHECK(reply(50, 18, {.torque = 1.5}, {0.75, -3.25}, 6).substr(0, 13) == "000#0187AD77A");
  CHECK(reply(50, 18, {}, {0, 0}, 7).substr(0, 13) == "000#017FFF7FF");
  CHECK(reply(50, 18, {}, {0, 0}, 7).substr(16) == "99");
  CHECK(reply(50, 18, {}, {0, 0}, 8).substr(16) == "1900");
  // Beyond the range the position goes round.
  CHECK(reply(50, 18, {}, {12.5 + 25. / 65535 * 1.5, 0}, 6).substr(0, 10) == "000#010000");
  // A simulation that has come apart: numbers as the firmware's processor converts them, and no
  // torque of them.
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(reply(50, 18, {.kp = 1}, {nan, nan}, 6) == "000#010000000000");
  CHECK(reply(50, 18, {}, {1e300, 1e300}, 6).substr(0, 13) == "000#010000FFF");
  MitDevice motor({.node = 1, .master = 0, .ranges = Ranges(50, 18)});
  motor.OnFrame(MakeSpecial(1, kEnter), 0);
  motor.OnFrame(MakeCommand(CommandLayout(Ranges(50, 18)), 1, {.kp = 1}), 0);
  CHECK(motor.Torque({nan, 0}) == 0);
  CHECK(motor.Torque({-1e300, 0}) == 18);
}

TEST_CASE("every position, velocity, gain and torque code can be sent and comes back") {
  const Layout layout = CommandLayout(Ranges(25.64, 18));
  for (size_t field = 0; field < 5; ++field) {
    for (uint64_t code = 0; code <= layout.fields[field].mask(); ++code) {
      const double value = layout.fields[field].offset + double(code) * layout.fields[field].scale;
      Setpoint s;
      *std::array{&s.position, &s.velocity, &s.kp, &s.kd, &s.torque}[field] = value;
      const auto v = DecodePayload(layout, MakeCommand(layout, 1, s));
      if (!v || (*v)[field] != value || !Holds(layout, s))
        FAIL(layout.fields[field].name << " " << code);
    }
  }
}

TEST_CASE("no command is a special frame") {
  const MitRanges ranges = Ranges(50, 18);
  const Layout layout = CommandLayout(ranges);
  for (uint64_t code = 0xFE0; code <= 0xFFF; ++code) {
    const double torque = layout.fields[4].offset + double(code) * layout.fields[4].scale;
    const Frame frame = MakeCommand(layout, 1, {12.5, 50, 500, 5, torque});
    INFO(ToText(frame));
    CHECK((code < 0xFF0) == (ToText(frame).substr(0, 18) == "001#FFFFFFFFFFFFFF"));
    const auto v = DecodePayload(layout, frame);
    CHECK((*v)[4] == Approx(torque));
    CHECK((*v)[0] == Approx(12.5).margin(5e-4));
  }
  CHECK(ToText(MakeSpecial(0x11, kEnter)) == "011#FFFFFFFFFFFFFFFC");
  CHECK(ToText(MakeSpecial(0x11, kExit)) == "011#FFFFFFFFFFFFFFFD");
}

TEST_CASE("what lies beyond a range is known to") {
  const Layout layout = CommandLayout(Ranges(50, 18));
  CHECK(Holds(layout, {.torque = 18}));
  CHECK_FALSE(Holds(layout, {.torque = 18.1}));
  CHECK_FALSE(Holds(layout, {.kp = -1}));
  CHECK_FALSE(Holds(layout, {.position = std::numeric_limits<double>::quiet_NaN()}));
  CHECK(Period(Ranges(50, 18)) == Approx(25 * 65536. / 65535));
  CHECK(DescribeError(1) == "over-temperature");
  CHECK(DescribeError(77) == "an unknown error");
}

}  // namespace
}  // namespace plumb::mit
