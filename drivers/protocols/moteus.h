#pragma once

#include <array>
#include <cstdint>
#include <initializer_list>
#include <numbers>
#include <span>
#include <string_view>

#include "common/special_numbers.h"
#include "drivers/protocols/fields.h"

/// mjbots' moteus controllers: registers that are written and read by frames of CAN FD. A frame is
/// a row of subframes, each of which says what to do with how many registers from which one on, and
/// in which of four number formats (int8, int16, int32, float); little-endian, filled up with
/// kNothing to a length that FD has. All positions are in turns of the output shaft, torques in Nm
/// there. Constants and pure functions: thread-safe.
///
/// From mjbots' documents at commit db1a7623 of github.com/mjbots/moteus: ids, subframes and an
/// example in docs/protocol/can.md; registers and the scales of integers in
/// docs/protocol/registers.md; and where these are silent, what the firmware does, as read in
/// fw/moteus_controller.cc (registers), fw/bldc_servo_control.h (modes and the watchdog),
/// fw/fdcan.cc and fw/fdcan_micro_server.h (frames), and mjlib/multiplex/micro_server.cc of
/// github.com/mjbots/mjlib (subframes).
namespace plumb::moteus {

inline constexpr double kTurn = 2 * std::numbers::pi;  ///< [rad]

/// Numbers that a motor may have (fw/moteus.cc); kEverybody is heard by all. The driver's own is 0,
/// as that of mjbots' tools is.
inline constexpr int kMaxNode = 126, kEverybody = 0x7F;

/// Subframes: | the number format | how many registers, 1 to 3; 0 = the next byte says.
enum Subframe : uint8_t {
  kWrite = 0x00,
  kRead = 0x10,
  kReply = 0x20,
  kWriteError = 0x30,
  kReadError = 0x31,
  kToMotor = 0x40,    ///< text for the motor's console: channel, length, text
  kFromMotor = 0x41,  ///< likewise, from it: the answer to the other two
  kAskText = 0x42,    ///< channel, the most that may come
  kNothing = 0x50,
  // the number formats
  kInt8 = 0x00,
  kInt16 = 0x04,
  kInt32 = 0x08,
  kFloat = 0x0C,
};

enum Register : uint16_t {
  kMode = 0x000,  ///< written first, it sets all others that are written to their defaults
  kPosition = 0x001,
  kVelocity = 0x002,
  kTorque = 0x003,
  kMotorTemperature = 0x00A,  ///< 0 where none is measured
  kTrajectoryComplete = 0x00B,
  kHomeState = 0x00C,
  kVoltage = 0x00D,
  kTemperature = 0x00E,
  kFault = 0x00F,
  kCommandPosition = 0x020,  ///< not-a-number: where it is
  kCommandVelocity = 0x021,
  kCommandTorque = 0x022,
  kKpScale = 0x023,  ///< of the gain that the motor has stored; 1 unless given
  kKdScale = 0x024,  ///< likewise; the firmware takes no more than kKpScale
  kMaxTorque = 0x025,
  kTimeout = 0x027,          ///< [s] for which the command holds; 0: what the motor has stored
  kIntegralScale = 0x02B,    ///< 1 unless given
  kMilliseconds = 0x070,     ///< since it has its power
  kFirmwareVersion = 0x101,  ///< a byte each of major, minor, micro
  kRegisterMap = 0x102,      ///< the meaning of all registers
};

/// Of the modes that kMode knows those that matter here.
enum Mode : int8_t {
  kStopped = 0,  ///< written, also clears a fault, and is the only way out of kTimedOut
  kFaulted = 1,
  kPreparing = 2,  ///< up to 4: on the way from kStopped to any that moves
  kPrepared = 4,
  kPositionMode = 10,
  kTimedOut = 11,      ///< no command for kTimeout; what it does then, servo.timeout_mode says
  kZeroVelocity = 12,  ///< brakes with a torque
};
inline constexpr int kLastMode = 15;

/// Meaning of registers, kRegisterMap, that this file knows: since "rezero state" became "home
/// state" (fw/moteus_controller.cc).
inline constexpr int kKnownMap = 5;

/// Said to its console while arming; the answer is a Mode as a number, and an end of line.
inline constexpr std::string_view kAskTimeoutMode = "conf get servo.timeout_mode\n";

namespace detail {
constexpr Field Int(std::string_view name, int byte, int bits, double scale = 1,
                    std::string_view unit = "") {
  return {name,
          static_cast<uint16_t>(8 * byte),
          static_cast<uint8_t>(bits),
          Field::Kind::kSigned,
          scale,
          unit};
}
constexpr Field Float(std::string_view name, int byte, std::string_view unit = "") {
  return {name, static_cast<uint16_t>(8 * byte), 32, Field::Kind::kFloat, 1, unit};
}
}  // namespace detail

/// A frame of one shape: what its subframes say is in `bytes`, and 0 where the fields are.
struct Shape {
  Layout layout;
  std::array<uint8_t, 48> bytes;
};

/// What is asked for in every cycle. Not in one go, as the registers are not one behind the other.
inline constexpr std::array<uint8_t, 9> kQuestion = {kRead | kInt8 | 1,  kMode,      //
                                                     kRead | kFloat | 3, kPosition,  // to kTorque
                                                     kRead | kInt8,      6,
                                                     kMotorTemperature,  // to kFault
                                                     kRead | kInt32 | 1, kMilliseconds};

/// The whole of a command in position mode, and kQuestion behind it:
///   torque = Kp_Scale kp (Position - position) + Kd_Scale kd (Velocity - velocity) + Torque_FF,
/// with the gains kp [Nm/turn] and kd [Nm s/turn] that the motor has stored, within +-Max_Torque;
/// for Timeout.
// clang-format off
inline constexpr Shape kCommand{
    {0, "Command", 48,
     {{detail::Int("Mode", 2, 8),
       detail::Float("Position", 6, "rev"), detail::Float("Velocity", 10, "rev/s"),
       detail::Float("Torque_FF", 14, "Nm"), detail::Float("Kp_Scale", 18),
       detail::Float("Kd_Scale", 22), detail::Float("Max_Torque", 26, "Nm"),
       detail::Int("Timeout", 32, 16, 1, "ms"), detail::Int("Integral_Scale", 36, 8, 1. / 127)}}},
    {kWrite | kInt8 | 1, kMode, 0,
     kWrite | kFloat, 6, kCommandPosition, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
                                           0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
     kWrite | kInt16 | 1, kTimeout, 0, 0,
     kWrite | kInt8 | 1, kIntegralScale, 0,
     kQuestion[0], kQuestion[1], kQuestion[2], kQuestion[3], kQuestion[4], kQuestion[5],
     kQuestion[6], kQuestion[7], kQuestion[8],
     kNothing, kNothing}};

/// The answer to kQuestion. Of an integer its most negative one says "not a number".
inline constexpr Shape kAnswer{
    {0, "Answer", 32,
     {{detail::Int("Mode", 2, 8),
       detail::Float("Position", 5, "rev"), detail::Float("Velocity", 9, "rev/s"),
       detail::Float("Torque", 13, "Nm"),
       detail::Int("Motor_Temperature", 20, 8, 1, "degC"),
       detail::Int("Trajectory_Complete", 21, 8),
       detail::Int("Home_State", 22, 8), detail::Int("Bus_Voltage", 23, 8, 0.5, "V"),
       detail::Int("Temperature", 24, 8, 1, "degC"), detail::Int("Fault", 25, 8),
       detail::Int("Uptime", 28, 32, 1, "ms")}}},
    {kReply | kInt8 | 1, kMode, 0,
     kReply | kFloat | 3, kPosition, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
     kReply | kInt8, 6, kMotorTemperature, 0, 0, 0, 0, 0, 0,
     kReply | kInt32 | 1, kMilliseconds, 0, 0, 0, 0}};

/// Firmware and register map, asked for while arming. Registers beyond 0x7F take two bytes.
inline constexpr std::array<uint8_t, 3> kVersionQuestion = {
    kRead | kInt32 | 2, (kFirmwareVersion & 0x7F) | 0x80, kFirmwareVersion >> 7};
inline constexpr Shape kVersion{
    {0, "Version", 12, {{detail::Int("Firmware", 3, 32), detail::Int("Register_Map", 7, 32)}}},
    {kReply | kInt32 | 2, kVersionQuestion[1], kVersionQuestion[2], 0, 0, 0, 0, 0, 0, 0, 0,
     kNothing}};
// clang-format on

/// The number of bytes that FD has for at least so many.
constexpr uint8_t FdLength(size_t size) {
  for (const uint8_t length : {8, 12, 16, 20, 24, 32, 48}) {
    if (size <= length) return size <= 8 ? static_cast<uint8_t>(size) : length;
  }
  return 64;
}

/// Of the id of a frame to a motor: whether it is to answer, and the number of who sends it, ours
/// being 0.
inline constexpr uint32_t kSourceBits = 0xFF00;
/// Of the frames to a motor that it answers. Without the highest bit of the 16 it obeys without a
/// word, which we never ask for. Extended, as 11 bits do not hold it.
constexpr uint32_t CommandId(int node) { return 0x8000 | static_cast<uint32_t>(node); }
/// Of its answers; extended beyond 0x7FF.
constexpr uint32_t AnswerId(int node) { return static_cast<uint32_t>(node) << 8; }

/// An FD frame of these parts one after the other. @param parts at most 64 bytes in all.
constexpr Frame MakeFrame(uint32_t id, std::initializer_list<std::span<const uint8_t>> parts) {
  Frame frame;
  frame.id = id;
  frame.extended = id > 0x7FF;
  frame.fd = frame.bit_rate_switch = true;
  size_t size = 0;
  for (const std::span<const uint8_t> part : parts) {
    for (const uint8_t byte : part) frame.data[size++] = byte;
  }
  frame.length = FdLength(size);
  while (size < frame.length) frame.data[size++] = kNothing;
  return frame;
}
constexpr Frame MakeFrame(uint32_t id, const Shape& shape, std::initializer_list<double> values) {
  Frame frame = MakeFrame(id, {std::span(shape.bytes).first(shape.layout.length)});
  EncodeFields(shape.layout, values, frame);
  return frame;
}

/// Whether a frame is of that shape, but for its values and its id.
constexpr bool HasShape(const Shape& shape, const Frame& frame) {
  if (frame.remote || frame.length != shape.layout.length) return false;
  std::array<bool, 48> free{};
  for (size_t i = 0; i < shape.layout.count(); ++i) {
    const Field& field = shape.layout.fields[i];
    for (size_t bit = field.bit; bit < size_t{field.bit} + field.bits; bit += 8)
      free[bit / 8] = true;
  }
  for (size_t byte = 0; byte < frame.length; ++byte) {
    if (!free[byte] && frame.data[byte] != shape.bytes[byte]) return false;
  }
  return true;
}

/// The contents of a command in position mode.
struct Setpoint {
  double position = kNaN;  ///< [turns]; nan: where it is
  double velocity = 0;     ///< [turns/s]
  double torque = 0;       ///< [Nm]
  double kp = 0, kd = 0;   ///< 0 to 1, of the gains that the motor has stored
  double max_torque = 0;   ///< [Nm]
  int64_t timeout = 0;     ///< [ms] up to 32767
};
constexpr Frame MakeCommand(int node, const Setpoint& s) {
  return MakeFrame(CommandId(node), kCommand,
                   {kPositionMode, s.position, s.velocity, s.torque, s.kp, s.kd, s.max_torque,
                    static_cast<double>(s.timeout), 0});
}

/// Stop, and then the question `more`.
constexpr Frame MakeStop(int node, std::span<const uint8_t> more = kQuestion) {
  constexpr std::array<uint8_t, 3> kStop = {kWrite | kInt8 | 1, kMode, kStopped};
  return MakeFrame(CommandId(node), {kStop, more});
}

/// Words for a fault or what limits the motor, such as "over voltage"; for a mode.
std::string_view DescribeFault(int fault) noexcept;
std::string_view DescribeMode(int mode) noexcept;
/// From here on they say what limits the motor, which is no fault.
inline constexpr int kFirstLimit = 96;

}  // namespace plumb::moteus
