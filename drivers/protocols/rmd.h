#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "drivers/protocols/fields.h"

/// MyActuator's RMD motors (X, L and H series with V3 and V4 drives): commands of 8 bytes to
/// 0x140 + node and answers of 8 bytes from 0x240 + node, the first byte of both says which, the
/// rest is little-endian. Positions and speeds are the output shaft's. Every command but kReset is
/// answered, and nothing is said unasked but kInterrupted.
///
/// Layouts from MyActuator's "Servo Motor Control Protocol" V4.2 (2024.05, "Motor Motion Protocol
/// V4.2-250208.pdf"), sections 2.11 to 2.32; what a motor does whose watchdog has expired, from
/// measurements at github.com/2b-t/myactuator_rmd_ros, pull request 4. Constants and pure
/// functions: thread-safe.
///
/// Which of its ways of moving the driver uses: kTorque, a torque current, and kAngle, asked for
/// behind each of them. The motion mode (0x400 + node, section 5), packed like the MIT protocol's,
/// would need half the frames, but
///  - its answer has steps of 3.8e-4 rad and ends at 12.5 rad; kAngle has 1.75e-4 rad and no end;
///  - a torque of 0 has no code in it, and 24 Nm is all it can say, of motors that have 100 Nm;
///  - published readers of its answer contradict each other: whether it holds what is, or echoes
///    what was asked for (github.com/yukunlin1124/myactuator_rmd_v4.3), 12.5 or 12.566 rad, Nm or
///    per cent;
///  - its commands have a lower priority than "shut down" (0x140): one that is held up in a
///    controller with several mailboxes would switch a motor on that has just been switched off.
/// The angle in the answers to kTorque is too coarse: one degree. Their speed, one degree per
/// second, is not.
namespace plumb::rmd {

inline constexpr int kMaxNode = 32;
inline constexpr uint32_t kCommands = 0x140, kAnswers = 0x240;
inline constexpr uint32_t kAllMotors = 0x280;  ///< commands to every motor on the bus
/// Of the motion mode, which a motor obeys whatever else it is told.
inline constexpr uint32_t kMotionCommands = 0x400, kMotionAnswers = 0x500;

/// The first byte of commands and answers.
enum Code : uint8_t {
  kReset = 0x76,
  kReleaseBrake = 0x77,
  kLockBrake = 0x78,
  kShutdown = 0x80,  ///< no output, no control: the only way to be rid of a torque for sure
  kStop = 0x81,      ///< holds the speed at 0, with a torque
  kAskAngle = 0x92,
  kAskStatus = 0x9A,
  kAskMotion = 0x9C,
  kTorqueControl = 0xA1,
  kAskUptime = 0xB1,
  kAskVersion = 0xB2,
  kSetWatchdog = 0xB3,
  kAskModel = 0xB5,
  kInterrupted = 0xF1,  ///< said when the watchdog has expired, and each second from then on
};

namespace detail {
constexpr Field U(std::string_view name, int bit, int bits, double scale = 1,
                  std::string_view unit = "") {
  return {
      name, static_cast<uint8_t>(bit), static_cast<uint8_t>(bits), Field::Kind::kUnsigned, scale,
      unit};
}
constexpr Field I(std::string_view name, int bit, int bits, double scale, std::string_view unit) {
  return {name, static_cast<uint8_t>(bit), static_cast<uint8_t>(bits), Field::Kind::kSigned, scale,
          unit};
}
constexpr Field Code() { return U("Code", 0, 8); }
/// What moves, after the code: of two answers.
constexpr Layout Motion(uint8_t code, std::string_view name) {
  return {code,
          name,
          8,
          {{Code(), I("Temperature", 8, 8, 1, "degC"), I("Current", 16, 16, 0.01, "A"),
            I("Speed", 32, 16, 1, "deg/s"), I("Coarse_Angle", 48, 16, 1, "deg")}}};
}
}  // namespace detail

/// A command that is its code alone, and the answer to one that changes something.
constexpr Layout Bare(uint8_t code, std::string_view name) {
  return {code, name, 8, {{detail::Code()}}};
}

// clang-format off
// Commands.
inline constexpr Layout kTorque{kTorqueControl, "Torque", 8,
    {{detail::Code(), detail::I("Current", 32, 16, 0.01, "A")}}};
inline constexpr Layout kWatchdog{kSetWatchdog, "Watchdog", 8,  // kept without power; 0 = off
    {{detail::Code(), detail::U("Time", 32, 32, 1, "ms")}}};

// Answers.
inline constexpr Layout kTorqueAnswer = detail::Motion(kTorqueControl, "Torque_Answer");
inline constexpr Layout kMotion = detail::Motion(kAskMotion, "Motion");
inline constexpr Layout kAngle{kAskAngle, "Angle", 8,
    {{detail::Code(), detail::I("Angle", 32, 32, 0.01, "deg")}}};
inline constexpr Layout kStatus{kAskStatus, "Status", 8,
    {{detail::Code(), detail::I("Motor_Temperature", 8, 8, 1, "degC"),
      detail::U("Brake_Released", 24, 8), detail::U("Bus_Voltage", 32, 16, 0.1, "V"),
      detail::U("Errors", 48, 16)}}};
inline constexpr Layout kUptime{kAskUptime, "Uptime", 8,
    {{detail::Code(), detail::U("Time", 32, 32, 1, "ms")}}};
inline constexpr Layout kVersion{kAskVersion, "Version", 8,  // a date such as 20220206
    {{detail::Code(), detail::U("Date", 32, 32)}}};
inline constexpr Layout kModel{kAskModel, "Model", 8,  // seven letters
    {{detail::Code(), detail::U("Letters_1_to_4", 8, 32), detail::U("Letters_5_to_7", 40, 24)}}};
// clang-format on

/// Words for the bits of Errors, such as "motor stall, low voltage", into a buffer.
/// @return the part of the buffer that was written; "no error" for 0.
std::string_view DescribeErrors(uint32_t errors, std::span<char> buffer) noexcept;

/// A command to one motor. @param value of the layout's field after the code, if it has one.
constexpr Frame MakeCommand(const Layout& layout, int node, double value = 0) {
  Frame frame;
  frame.id = kCommands + static_cast<uint32_t>(node);
  EncodePayload(layout, {static_cast<double>(layout.command), value}, frame);
  return frame;
}
constexpr Frame MakeCommand(Code code, int node) { return MakeCommand(Bare(code, ""), node); }

}  // namespace plumb::rmd
