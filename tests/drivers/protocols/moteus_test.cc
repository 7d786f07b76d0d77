// The bytes of mjbots' protocol: what we send, written by hand, and what the virtual motor makes of
// frames that mjbots have published, at commit db1a7623 of github.com/mjbots/moteus:
// docs/protocol/can.md, docs/integration/can-fd.md, and
// lib/cpp/mjbots/moteus/test/moteus_protocol_test.cc.

#include "drivers/protocols/moteus.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "drivers/protocols/moteus_device.h"
#include "drivers/protocols/moteus_reports.h"

namespace plumb {
namespace {

using namespace moteus;
using Catch::Contains;

constexpr double kTurn = 2 * std::numbers::pi;

/// A frame of FD from its bytes, filled up as an adapter does.
Frame Fd(uint32_t id, const std::string& hex) {
  std::vector<uint8_t> bytes;
  for (size_t i = 0; i < hex.size(); i += 2)
    bytes.push_back(static_cast<uint8_t>(std::stoi(hex.substr(i, 2), nullptr, 16)));
  return MakeFrame(id, {bytes});
}
std::string Hex(const Frame& frame) {
  std::string hex;
  for (const uint8_t byte : frame.payload()) hex += fmt::format("{:02x}", byte);
  return hex;
}

/// A motor that has been asked.
struct Asked {
  explicit Asked(const MoteusDevice::Settings& settings = {}) : device(settings) {
    device.Reboot(0, 0);
  }
  /// The answer, padding included; empty if there is none.
  std::string Ask(const std::string& hex, uint32_t id = 0x8001) {
    now += 20'000;
    FrameBatch out;
    device.OnFrame(Fd(id, hex), now);
    device.Tick(now, sample, out);
    CHECK(out.size() <= 1);
    if (out.size() == 0) return "";
    CHECK(out.frames()[0].id == 0x100);
    CHECK_FALSE(out.frames()[0].extended);
    CHECK(out.frames()[0].fd);
    CHECK(out.frames()[0].bit_rate_switch);
    return Hex(out.frames()[0]);
  }
  MoteusDevice device;
  MoteusDevice::Sample sample{};
  int64_t now = 0;
};

TEST_CASE("a moteus' command, byte by byte") {
  const Frame frame = MakeCommand(5, {.torque = 1.5, .max_torque = 3, .timeout = 100});
  CHECK(ToText(frame) ==
        "00008005##1"
        "01000A"  // int8 0x000: position mode
        "0C0620"  // 6 floats from 0x020 on
        "0000C07F"
        "00000000"
        "0000C03F"
        "00000000"
        "00000000"
        "00004040"
        "05276400"  // int16 0x027: 100 ms
        "012B00"    // int8 0x02b: no integral
        "1100"
        "1F01"
        "10060A"
        "1970"  // the question
        "5050");
  CHECK(IsWellFormed(frame));
  CHECK(HasShape(kCommand, frame));
  CHECK(ToText(MakeCommand(5, {.position = 0.25,
                               .velocity = -2,
                               .torque = -1,
                               .kp = 1,
                               .kd = 0.5,
                               .max_torque = 8,
                               .timeout = 250}))
            .substr(11, 72) ==
        "01000A0C06200000803E000000C0000080BF0000803F0000003F000000410527FA00012B");
  CHECK(ToText(MakeStop(1)) == "00008001##101000011001F0110060A1970");
  CHECK(ToText(MakeFrame(CommandId(126), {kQuestion})) == "0000807E##111001F0110060A1970505050");
  CHECK(ToText(MakeStop(1, kVersionQuestion)) == "00008001##10100001A8102");
}

TEST_CASE("the lengths that FD has") {
  const int table[][2] = {{0, 0},   {3, 3},   {8, 8},   {9, 12},  {12, 12}, {13, 16}, {24, 24},
                          {25, 32}, {32, 32}, {33, 48}, {48, 48}, {49, 64}, {64, 64}};
  for (const auto& [size, length] : table) CHECK(FdLength(static_cast<size_t>(size)) == length);
}

TEST_CASE("a moteus' answer, byte by byte") {
  // Position mode, 2.5 turns, -1 turn/s, 0.5 Nm; thermistor 40 degC, home state 1, 24 V, 35 degC,
  // limited by its current, 70000 ms.
  const Frame frame = Fd(0x100,
                         "21000a"
                         "2f01"
                         "00002040"
                         "000080bf"
                         "0000003f"
                         "20060a"
                         "280001302363"
                         "297070110100");
  REQUIRE(frame.length == 32);
  MoteusReports reports;
  CHECK(reports.OnFrame(frame, 1) == FrameUse::kEstimate);
  CHECK(reports.mode() == kPositionMode);
  CHECK(reports.estimate().position == Approx(2.5 * kTurn));
  CHECK(reports.estimate().velocity == Approx(-kTurn));
  CHECK(reports.torque_estimate() == 0.5);
  CHECK(reports.readings().motor_temperature == 40);
  CHECK(reports.readings().drive_temperature == 35);
  CHECK(reports.readings().bus_voltage == 24);
  CHECK(reports.fault() == 99);
  CHECK(DescribeFault(reports.fault()) == "limited by its current");
}

TEST_CASE("of garbage a moteus' host keeps nothing") {
  const std::string good = "21000a2f0100002040000080bf0000003f20060a280001302363297070110100";
  MoteusReports reports;
  REQUIRE(reports.OnFrame(Fd(0x100, good), 1) == FrameUse::kEstimate);
  const auto refused = [&](const std::string& hex) {
    INFO(hex);
    CHECK(reports.OnFrame(Fd(0x100, hex), 2) == FrameUse::kRejected);
    CHECK(reports.estimate().position == Approx(2.5 * kTurn));
    CHECK(reports.mode() == kPositionMode);
  };
  for (const size_t byte : {0, 1, 3, 4, 17, 18, 19, 26, 27}) {  // of the subframes
    std::string other = good;
    other[2 * byte] = other[2 * byte] == '7' ? '6' : '7';
    refused(other);
  }
  refused(std::string(good).replace(4, 2, "10"));  // a mode that there is not
  refused(std::string(good).replace(4, 2, "ff"));
  refused(good.substr(0, 48));
  refused("310001" + good.substr(6));  // it knows no such register
  refused("");
  refused("41010561");  // text that is shorter than it says
  refused("41020161");  // another channel
}

TEST_CASE("a moteus without an encoder has no position, but a mode") {
  const std::string good = "21000a2f0100002040000080bf0000003f20060a280001302363297070110100";
  MoteusReports reports;
  REQUIRE(reports.OnFrame(Fd(0x100, good), 1) == FrameUse::kEstimate);
  for (const auto& [at, number] : {std::pair{10, "0000c07f"}, std::pair{18, "0000807f"}}) {
    std::string other = good;
    other.replace(4, 2, "01").replace(static_cast<size_t>(at), 8, number);
    CHECK(reports.OnFrame(Fd(0x100, other), 2) == FrameUse::kNotFinite);
    CHECK(reports.mode() == kFaulted);
    CHECK(reports.estimate().position == Approx(2.5 * kTurn));
    CHECK(reports.estimate().velocity == Approx(-kTurn));
  }
}

TEST_CASE("what integers cannot say, and a thermistor that there is not, are no readings") {
  MoteusReports reports;
  REQUIRE(reports.OnFrame(Fd(0x100,
                             "210000"
                             "2f01"
                             "0000204000000000"
                             "0000c07f"
                             "20060a"
                             "000000808000"
                             "2970"
                             "00000000"),
                          5) == FrameUse::kEstimate);
  CHECK(std::isnan(reports.torque_estimate()));
  CHECK(std::isnan(reports.readings().motor_temperature));
  CHECK(std::isnan(reports.readings().drive_temperature));
  CHECK(std::isnan(reports.readings().bus_voltage));
  CHECK(reports.readings().temperatures_at == 0);
}

TEST_CASE("mjbots' example of a command and its answer") {
  // docs/protocol/can.md: 0.0096 turns, 0.072 turns/s, -1.76 Nm; 0.0080, 0.064, -1.44 Nm, 12 V,
  // 20 degC. Gains that make of the one torque the other.
  Asked motor({.node = 1, .kp = 199.9, .kd = 0, .bus_voltage = 12, .temperature = 20});
  motor.sample = {0.00800001 * kTurn, 0.06400001 * kTurn};
  const std::string command = "01000a07206000200150ff140400130d";
  motor.Ask(command);
  CHECK(motor.Ask(command) == "2404000a005000000170ff230d181400");
}

TEST_CASE("frames of mjbots' own tests and documents, as the virtual motor reads them") {
  Asked motor;
  SECTION("all of a position command in int16") {
    motor.Ask("01000a040b20c409d0076400ff1fff0f2003204ec800204ed0072800");
    const Setpoint& setpoint = motor.device.setpoint();
    CHECK(setpoint.position == Approx(0.25));
    CHECK(setpoint.velocity == Approx(0.5));
    CHECK(setpoint.torque == Approx(1));
    CHECK(setpoint.kp == Approx(0.25).margin(1. / 32767));
    CHECK(setpoint.kd == Approx(0.125).margin(1. / 32767));
    CHECK(setpoint.max_torque == Approx(8));
    CHECK(setpoint.timeout == 200);
    CHECK(motor.device.rejected() == 0);
  }
  SECTION("a position command in floats with the usual question") {
    motor.sample = {-0.5 * kTurn, 0.25 * kTurn};
    motor.Ask("01000a0e200000803f0000004011001f01130d");
    CHECK(motor.device.setpoint().position == 1);
    CHECK(motor.device.setpoint().velocity == 2);
    CHECK(motor.device.setpoint().kp == 1);
    CHECK(std::isnan(motor.device.setpoint().max_torque));
    // 22 bytes, as the test of Query says, and two to fill up.
    const std::string answer = motor.Ask("11001f01130d");
    CHECK(answer ==
          "21000a"
          "2f01"
          "000000bf"
          "0000803e"
          "cdccc240"
          "230d301900"
          "5050");
  }
  SECTION("mode and fault") {
    CHECK(motor.Ask("1100110f") == "210000210f00");
    motor.device.set_fault(34);
    CHECK(motor.Ask("1100110f") == "210001210f22");
  }
  SECTION("stop") {
    motor.device.set_fault(34);
    CHECK(motor.Ask("0100001100") == "210000");
    CHECK(motor.device.mode() == kStopped);
    CHECK(motor.device.fault() == 0);
  }
  SECTION("text for the console, and what it says") {
    CHECK(motor.Ask("40010974656c2073746f700a") == "410100");             // tel stop
    CHECK_THAT(motor.Ask("420130"), Contains("45525220756e6b6e6f776e"));  // ERR unknown
    CHECK(motor.Ask("420130") == "410100");
  }
}

TEST_CASE("the virtual motor answers who asks for it, and obeys all the same") {
  Asked motor;
  CHECK(motor.Ask("01000a", 0x0001).empty());
  CHECK(motor.device.mode() != kStopped);
  CHECK(motor.Ask("01000a", 0x8002).empty());
  CHECK(motor.Ask("0100001100", 0x807F) == "210000");  // everybody
  CHECK(motor.device.mode() == kStopped);
}

TEST_CASE("registers that a virtual moteus does not know are errors with their numbers") {
  Asked motor;
  CHECK(motor.Ask("1a8102"
                  "1160") ==
        "2a8102"
        "07010000"
        "05000000"
        "316001"
        "5050");
  CHECK(motor.Ask("1160"
                  "1100") == "316001");  // and nothing more
  CHECK(motor.Ask("016000"
                  "1100") == "306001210000");
}

TEST_CASE("writing the mode sets a command back to its defaults: full gains") {
  Asked motor;
  motor.Ask(
      "01000a"
      "0d22"
      "0000803f"
      "0223"
      "0000");
  CHECK(motor.device.setpoint().kp == 0);
  motor.Ask(
      "01000a"
      "0d22"
      "0000803f");
  CHECK(motor.device.setpoint().kp == 1);
  CHECK(motor.device.setpoint().position == 0);
}

TEST_CASE("the watchdog of a virtual moteus: only commands feed it, only stop leads back") {
  Asked motor({.default_timeout = 0});
  const std::string command = Hex(MakeCommand(1, {.torque = 1, .max_torque = 3, .timeout = 100})),
                    question = "1100";
  motor.Ask(command);
  motor.Ask(command);
  CHECK(motor.device.armed());
  CHECK(motor.device.Torque(motor.sample) == 1);
  CHECK(motor.device.NextDue() == motor.now + 100'000);
  for (int i = 0; i < 4; ++i) CHECK(motor.Ask(question) == "21000a");
  CHECK(motor.Ask(question) == "21000b");  // timeout
  CHECK(motor.device.Torque(motor.sample) == 0);
  motor.Ask(command);
  CHECK(motor.Ask(command).substr(0, 6) == "21000b");
  CHECK(motor.device.Torque(motor.sample) == 0);
  motor.Ask("010000");
  motor.Ask(command);
  motor.Ask(command);
  CHECK(motor.device.armed());
}

TEST_CASE("a moteus as it is delivered brakes when its commands stay away") {
  Asked motor({.timeout_mode = kZeroVelocity});
  const std::string command = Hex(MakeCommand(1, {.torque = 1, .max_torque = 3, .timeout = 100}));
  motor.Ask(command);
  motor.Ask(command);
  for (int i = 0; i < 6; ++i) motor.Ask("1100");
  CHECK(motor.device.mode() == kTimedOut);
  CHECK(motor.device.Torque({0, -10 * kTurn}) == Approx(0.5));
  CHECK(motor.device.Torque({0, 1000 * kTurn}) == Approx(-5));
}

TEST_CASE("position mode: gains, targets and limits") {
  Asked motor({.most_torque = 20});
  const auto torque = [&](const Setpoint& setpoint, const MoteusDevice::Sample& sample) {
    motor.Ask(Hex(MakeCommand(1, setpoint)));
    motor.Ask(Hex(MakeCommand(1, setpoint)));
    return motor.device.Torque(sample);
  };
  // As delivered: 4 Nm/turn and 0.05 Nm s/turn.
  CHECK(torque({.position = 1,
                .velocity = 2,
                .torque = 0.5,
                .kp = 0.5,
                .kd = 0.5,
                .max_torque = 9,
                .timeout = 100},
               {0, 0}) == Approx(0.5 * 4 * 1 + 0.5 * 0.05 * 2 + 0.5));
  CHECK(torque({.position = 1, .kp = 1, .max_torque = 3, .timeout = 100}, {0, 0}) == 3);
  CHECK(torque({.torque = -30, .max_torque = 25, .timeout = 100}, {0, 0}) == -20);
  // No damping beyond the share of the stiffness, as the firmware has it.
  CHECK(torque({.velocity = 2, .torque = 1, .kp = 0, .kd = 1, .max_torque = 9, .timeout = 100},
               {0, 0}) == 1);
  CHECK(torque({.kp = 1, .max_torque = 9, .timeout = 100}, {5 * kTurn, 0}) == 0);  // where it is
}

}  // namespace
}  // namespace plumb
