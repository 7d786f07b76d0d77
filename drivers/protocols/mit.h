#pragma once

#include <cmath>
#include <cstdint>

#include "drivers/protocols/fields.h"
#include "robot/description.h"

/// The protocol of MIT's mini-cheetah actuator, which T-Motor's and CubeMars' AK series and others
/// speak, too: one 8-byte command to the motor's id, one reply to the master's id, both packed
/// big-endian in codes that divide ranges evenly. Nothing in a frame says which ranges: they are
/// configuration (MitRanges), since the sources disagree even about one and the same motor.
/// Positions and torques are the output shaft's. Constants and pure functions: thread-safe.
///
/// Layouts and behaviour from bgkatz/motorcontrol (Core/Src/can.c, fsm.c, stm32f4xx_it.c), the
/// firmware by the actuator's author; lengths 6 and 8 of the reply from CubeMars' AK series manual.
namespace plumb::mit {

/// Of a command frame, sent at all times: byte 7 of a frame whose bytes 0 to 6 are 0xFF. The motor
/// looks for these in the data of any command.
enum Special : uint8_t {
  kEnter = 0xFC,  ///< motor mode: obey commands
  kExit = 0xFD,   ///< rest mode
  /// make the present position 0. We never send it: it destroys what was calibrated
  kZero = 0xFE,
};

/// Error codes in byte 7 of an 8-byte reply.
enum Error : uint8_t {
  kNoError = 0,
  kOverTemperature = 1,
  kOverCurrent = 2,
  kOverVoltage = 3,
  kUnderVoltage = 4,
  kEncoderError = 5,
  kPhaseUnbalance = 6
};
std::string_view DescribeError(int error) noexcept;

namespace detail {
constexpr Field Symmetric(std::string_view name, int bit, int bits, double most,
                          std::string_view unit) {
  return RangeField(name, bit, bits, -most, most, unit);
}
constexpr Field Byte(std::string_view name, int bit, Field::Kind kind, double scale,
                     std::string_view unit) {
  return {name, static_cast<uint8_t>(bit), 8, kind, scale, unit, Field::Order::kBigEndian};
}
constexpr Layout Reply(const MitRanges& ranges, std::string_view name, uint8_t length) {
  return {0,
          name,
          length,
          {{Byte("Motor_ID", 0, Field::Kind::kUnsigned, 1, ""),
            Symmetric("Position", 8, 16, ranges.position, "rad"),
            Symmetric("Velocity", 24, 12, ranges.velocity, "rad/s"),
            Symmetric("Torque", 36, 12, ranges.torque, "Nm")}}};
}
}  // namespace detail

/// Torque = Kp (Position - position) + Kd (Velocity - velocity) + Torque_FF.
constexpr Layout CommandLayout(const MitRanges& ranges) {
  using detail::Symmetric;
  return {0,
          "Command",
          8,
          {{Symmetric("Position", 0, 16, ranges.position, "rad"),
            Symmetric("Velocity", 16, 12, ranges.velocity, "rad/s"),
            RangeField("Kp", 28, 12, 0, ranges.kp, "Nm/rad"),
            RangeField("Kd", 40, 12, 0, ranges.kd, "Nm s/rad"),
            Symmetric("Torque_FF", 52, 12, ranges.torque, "Nm")}}};
}

/// A reply's length tells its kind.
enum ReplyLength : uint8_t {
  kPlain = 6,           ///< AK series, first generation
  kWithVoltage = 7,     ///< bgkatz
  kWithTemperature = 8  ///< AK series, later ones: temperature and error
};
/// The torque is what the motor estimates from its current.
constexpr Layout ReplyLayout(const MitRanges& ranges, uint8_t length) {
  Layout layout = detail::Reply(ranges, "Reply", length);
  if (length == kWithVoltage) {
    layout.fields[4] = detail::Byte("Bus_Voltage", 48, Field::Kind::kUnsigned, 40. / 255, "V");
  } else if (length == kWithTemperature) {
    layout.fields[4] = detail::Byte("Temperature", 48, Field::Kind::kSigned, 1, "degC");
    layout.fields[5] = detail::Byte("Error", 56, Field::Kind::kUnsigned, 1, "");
  }
  return layout;
}

/// [rad] after which the position in a reply begins anew: the firmware packs more turns into 16
/// bits than they hold, and the codes go round.
constexpr double Period(const MitRanges& ranges) { return 2 * ranges.position * 65536. / 65535.; }

/// The contents of a command.
struct Setpoint {
  double position = 0;  ///< [rad]
  double velocity = 0;  ///< [rad/s]
  double kp = 0;        ///< [Nm/rad] >= 0
  double kd = 0;        ///< [Nm s/rad] >= 0
  double torque = 0;    ///< [Nm]
};

/// True if all of it is finite and within the ranges.
constexpr bool Holds(const Layout& command, const Setpoint& s) {
  return command.fields[0].Holds(s.position) && command.fields[1].Holds(s.velocity) &&
         command.fields[2].Holds(s.kp) && command.fields[3].Holds(s.kd) &&
         command.fields[4].Holds(s.torque);
}

/// A command's frame, to the nearest code, saturated at the ranges' ends. Never one of the special
/// ones: their neighbours are, in words, "everything at its most"; such a command gets one position
/// code less.
/// @param command CommandLayout. @param s finite.
constexpr Frame MakeCommand(const Layout& command, int node, const Setpoint& s) {
  Frame frame;
  frame.id = static_cast<uint32_t>(node);
  EncodePayload(command, {s.position, s.velocity, s.kp, s.kd, s.torque}, frame);
  bool full = frame.data[7] >= 0xF0;
  for (size_t i = 0; i < 7; ++i) full = full && frame.data[i] == 0xFF;
  if (full) frame.data[1] = 0xFE;
  return frame;
}

constexpr Frame MakeSpecial(int node, Special special) {
  Frame frame;
  frame.id = static_cast<uint32_t>(node);
  frame.length = 8;
  for (size_t i = 0; i < 7; ++i) frame.data[i] = 0xFF;
  frame.data[7] = special;
  return frame;
}

}  // namespace plumb::mit
