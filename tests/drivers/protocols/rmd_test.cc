#include "drivers/protocols/rmd.h"

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "drivers/protocols/rmd_device.h"

namespace plumb::rmd {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

FieldValues Decode(const Layout& layout, const char* text) {
  const auto values = DecodePayload(layout, *FrameFromText(text));
  REQUIRE(values);
  CHECK((*values)[0] == layout.command);
  return *values;
}

// All frames here are the examples of MyActuator's manual V4.2, with the numbers that it reads from
// them; the sections are the manual's.

TEST_CASE("RMD commands have the manual's bytes") {
  CHECK(ToText(MakeCommand(kTorque, 1, 1)) == "141#A100000064000000");    // 2.19.4, 1 A
  CHECK(ToText(MakeCommand(kTorque, 1, -1)) == "141#A10000009CFF0000");   // -1 A
  CHECK(ToText(MakeCommand(kWatchdog, 1, 0)) == "141#B300000000000000");  // 2.30.4
  CHECK(ToText(MakeCommand(kWatchdog, 1, 1000)) == "141#B3000000E8030000");
  CHECK(ToText(MakeCommand(kAskAngle, 1)) == "141#9200000000000000");      // 2.12.4
  CHECK(ToText(MakeCommand(kAskStatus, 1)) == "141#9A00000000000000");     // 2.14.4
  CHECK(ToText(MakeCommand(kAskMotion, 1)) == "141#9C00000000000000");     // 2.15.4
  CHECK(ToText(MakeCommand(kAskUptime, 1)) == "141#B100000000000000");     // 2.28.4
  CHECK(ToText(MakeCommand(kAskVersion, 1)) == "141#B200000000000000");    // 2.29.4
  CHECK(ToText(MakeCommand(kAskModel, 1)) == "141#B500000000000000");      // 2.32.4
  CHECK(ToText(MakeCommand(kShutdown, 1)) == "141#8000000000000000");      // 2.17.2
  CHECK(ToText(MakeCommand(kReleaseBrake, 2)) == "142#7700000000000000");  // 2.26.2
  CHECK(ToText(MakeCommand(kLockBrake, 32)) == "160#7800000000000000");    // 2.27.2
}

TEST_CASE("RMD answers say what the manual reads from them") {
  const FieldValues torque = Decode(kTorqueAnswer, "241#A1326400F4012D00");  // 2.19.4
  CHECK(torque[1] == 50);
  CHECK(torque[2] == Approx(1));
  CHECK(torque[3] == 500);
  CHECK(torque[4] == 45);
  const FieldValues back = Decode(kTorqueAnswer, "241#A1329CFF0CFED3FF");
  CHECK(back[2] == Approx(-1));
  CHECK(back[3] == -500);
  CHECK(back[4] == -45);
  const FieldValues motion = Decode(kMotion, "241#9C326400F4012D00");  // 2.15.4
  CHECK(motion[1] == 50);
  CHECK(motion[2] == Approx(1));
  CHECK(motion[3] == 500);
  CHECK(Decode(kAngle, "241#92000000A08C0000")[1] == Approx(360));     // 2.12.4
  CHECK(Decode(kAngle, "241#920000006073FFFF")[1] == Approx(-360));    // as 2.23.4 writes -360
  const FieldValues status = Decode(kStatus, "241#9A320001E5010400");  // 2.14.4
  CHECK(status[1] == 50);
  CHECK(status[2] == 1);
  CHECK(status[3] == Approx(48.5));
  CHECK(status[4] == 4);
  CHECK(Decode(kUptime, "241#B100000000000010")[1] == 268435456);  // 2.28.4
  CHECK(Decode(kVersion, "241#B20000002E893401")[1] == 20220206);  // 2.29.4
  CHECK_FALSE(DecodePayload(kAngle, *FrameFromText("241#92000000A08C00")));
}

TEST_CASE("RMD errors have names") {
  std::array<char, 200> words;
  CHECK(DescribeErrors(0, words) == "no error");
  CHECK(DescribeErrors(0x0004, words) == "low voltage");
  CHECK(DescribeErrors(0x0016, words) == "motor stall, low voltage, over-current");  // 2.14.3
  CHECK(DescribeErrors(0x3000, words) == "motor over-temperature, encoder calibration error");
  CHECK(DescribeErrors(0x0200, words) == "an unknown error");
  CHECK(DescribeErrors(0x0201, words) == "an unknown error");
  CHECK(DescribeErrors(0xFFFF, words).ends_with("calibration error, an unknown error"));
  std::array<char, 12> few;
  CHECK(DescribeErrors(0x0016, few) == "motor stall,");
}

/// What a motor that runs answers to the frames.
std::string Answer(RmdDevice& motor, const char* command, const RmdDevice::Sample& sample,
                   int64_t now = 0) {
  FrameBatch out;
  motor.OnFrame(*FrameFromText(command), now);
  motor.Tick(now, sample, out);
  return out.size() == 1 ? ToText(out.frames()[0]) : "";
}

TEST_CASE("the virtual RMD motor answers with the manual's bytes") {
  RmdDevice motor({.node = 1, .bus_voltage = 48.5, .temperature = 50});
  // Just beyond the numbers of the examples: it cuts off.
  const RmdDevice::Sample there{45.009 * kDegree, 500.5 * kDegree},
      back{-45.009 * kDegree, -500.5 * kDegree};
  CHECK(Answer(motor, "141#7700000000000000", there) == "241#7700000000000000");
  CHECK(Answer(motor, "141#A100000064000000", there) == "241#A1326400F4012D00");
  CHECK(motor.Torque() == Approx(1));
  CHECK(Answer(motor, "141#A10000009CFF0000", back) == "241#A1329CFF0CFED3FF");
  CHECK(Answer(motor, "141#A100000064000000", there) == "241#A1326400F4012D00");
  CHECK(Answer(motor, "141#9C00000000000000", there) == "241#9C326400F4012D00");
  CHECK(Answer(motor, "141#9200000000000000", {2 * std::numbers::pi + 1e-6, 0}) ==
        "241#92000000A08C0000");
  CHECK(Answer(motor, "141#B200000000000000", there) == "241#B20000002E893401");
  CHECK(Answer(motor, "141#B500000000000000", there) == "241#B558385332563130");
  CHECK(Answer(motor, "141#B100000000000000", there, 268'435'456'000) == "241#B100000000000010");
  motor.set_errors(4);
  CHECK(motor.Torque() == 0);
  CHECK(Answer(motor, "141#9A00000000000000", there) == "241#9A320001E5010400");
  CHECK(Answer(motor, "141#8000000000000000", there) == "241#8000000000000000");
  CHECK(Answer(motor, "280#8000000000000000", there) == "241#8000000000000000");
  CHECK(Answer(motor, "141#B3000000E8030000", there) == "241#B3000000E8030000");
  CHECK(motor.watchdog() == 1'000'000);
  CHECK(Answer(motor, "141#7600000000000000", there).empty());  // it has no time to answer
  CHECK(motor.rejected() == 0);
}

TEST_CASE("the virtual RMD motor: what makes a torque, and what takes it away") {
  RmdDevice motor({.node = 3, .torque_constant = 2, .current = 5});
  const RmdDevice::Sample rest;
  Answer(motor, "143#A1000000C8000000", rest);
  CHECK(motor.Torque() == 0);  // its brake is locked
  CHECK_FALSE(motor.armed());
  Answer(motor, "143#7700000000000000", rest);
  CHECK(motor.Torque() == 0);
  Answer(motor, "143#A1000000C8000000", rest);
  CHECK(motor.Torque() == Approx(4));
  CHECK(motor.armed());
  Answer(motor, "143#A1000000FF7F0000", rest);
  CHECK(motor.Torque() == 10);  // all it can
  for (const char* stop : {"143#8000000000000000", "280#8000000000000000", "143#7600000000000000",
                           "143#7800000000000000"}) {
    INFO(stop);
    Answer(motor, "143#7700000000000000", rest);
    Answer(motor, "143#A1000000C8000000", rest);
    CHECK(motor.armed());
    Answer(motor, stop, rest);
    CHECK(motor.Torque() == 0);
    CHECK_FALSE(motor.armed());
  }
  Answer(motor, "143#7700000000000000", rest);
  Answer(motor, "143#A1000000C8000000", rest);
  Answer(motor, "143#8100000000000000", rest);  // stops, and stays under control
  CHECK(motor.Torque() == 0);
  CHECK(motor.armed());
  motor.set_errors(0x10);
  Answer(motor, "143#A1000000C8000000", rest);
  CHECK_FALSE(motor.armed());
  CHECK(motor.rejected() == 0);
  // Foreign ones, and those that are none.
  for (const char* other :
       {"142#A1000000C8000000", "243#A1000000C8000000", "00000143#A1", "143##1A1000000C8000000"}) {
    CHECK(Answer(motor, other, rest).empty());
  }
  CHECK(motor.rejected() == 0);
  int64_t rejected = 0;
  for (const char* bad : {"143#A1000000C80000", "143#", "143#R8", "143#0000000000000000"}) {
    INFO(bad);
    CHECK(Answer(motor, bad, rest).empty());
    CHECK(motor.rejected() == ++rejected);
  }
}

TEST_CASE("the virtual RMD motor's watchdog: off, said, and the next command ignored") {
  RmdDevice motor({.node = 1, .watchdog = 100'000});
  const RmdDevice::Sample sample{1, 0};
  Answer(motor, "141#7700000000000000", sample, 0);
  Answer(motor, "141#A1000000C8000000", sample, 50'000);
  CHECK(motor.NextDue() == 150'000);
  FrameBatch out;
  motor.Tick(149'999, sample, out);
  CHECK(motor.Torque() == Approx(2));
  CHECK(out.size() == 0);
  motor.Tick(150'000, sample, out);
  CHECK(motor.Torque() == 0);
  CHECK_FALSE(motor.brake_released());
  motor.Tick(1'149'999, sample, out);
  REQUIRE(out.size() == 1);
  CHECK(ToText(out.frames()[0]) == "241#F100000000000000");
  CHECK(motor.NextDue() == 1'150'000);
  motor.Tick(1'150'000, sample, out);
  CHECK(out.size() == 2);
  // The trap: an echo that reads as an angle of 0.
  CHECK(Answer(motor, "141#9200000000000000", sample, 1'200'000) == "241#9200000000000000");
  CHECK(Answer(motor, "141#9200000000000000", sample, 1'200'100) == "241#9200000061160000");
  CHECK(motor.watchdog_writes() == 0);
}

TEST_CASE("a simulation that has come apart is answered, too") {
  RmdDevice motor({.node = 1});
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(Answer(motor, "141#9200000000000000", {nan, nan}) == "241#9200000000000000");
  CHECK(Answer(motor, "141#9200000000000000", {1e300, 0}) == "241#92000000FFFFFF7F");
  CHECK(Answer(motor, "141#9C00000000000000", {-1e300, 1e300}) == "241#9C190000FF7F0080");
  CHECK_THROWS_AS(RmdDevice({.node = 0}), std::invalid_argument);
  CHECK_THROWS_AS(RmdDevice({.node = 33}), std::invalid_argument);
  CHECK_THROWS_AS(RmdDevice({.torque_constant = 0}), std::invalid_argument);
  CHECK_THROWS_AS(RmdDevice({.current = nan}), std::invalid_argument);
}

}  // namespace
}  // namespace plumb::rmd
