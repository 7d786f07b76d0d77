#pragma once

#include "drivers/protocols/fields.h"

/// Xsens' MTi-600, Avior and Sirius on CAN: one quantity per message, big-endian, fixed-point.
/// Layouts from Movella's "MTi CAN messages" (mtidocs.movella.com/canmessages); ids are the
/// factory's, to which SensorDescription::base is added (they can be moved with
/// SetCanOutputConfig). Status bits as in Xsens' public XsStatusFlag. Thread-safe.
namespace plumb::xsens {

namespace detail {
constexpr Field U(std::string_view name, int bits, std::string_view unit = "") {
  return {name, 0,    static_cast<uint8_t>(bits), Field::Kind::kUnsigned,
          1,    unit, Field::Order::kBigEndian};
}
constexpr Field I16(std::string_view name, int index, double scale, std::string_view unit) {
  return {name, static_cast<uint8_t>(16 * index), 16, Field::Kind::kSigned, scale,
          unit, Field::Order::kBigEndian};
}
}  // namespace detail

// clang-format off
inline constexpr Layout kError{0x01, "Error", 1, {{detail::U("Error_Code", 8)}}};
inline constexpr Layout kWarning{0x02, "Warning", 1, {{detail::U("Warning_Code", 8)}}};
// ticks, see SensorDescription::tick
inline constexpr Layout kSampleTime{0x05, "SampleTime", 4, {{detail::U("Sample_Time", 32)}}};
inline constexpr Layout kGroupCounter{0x06, "GroupCounter", 2, {{detail::U("Group_Counter", 16)}}};
inline constexpr Layout kStatusWord{0x11, "StatusWord", 4, {{detail::U("Status", 32)}}};
inline constexpr Layout kQuaternion{0x21, "Quaternion", 8,
    {{detail::I16("Q0", 0, 1. / 32767, ""), detail::I16("Q1", 1, 1. / 32767, ""),
      detail::I16("Q2", 2, 1. / 32767, ""),
      detail::I16("Q3", 3, 1. / 32767, "")}}};
inline constexpr Layout kEulerAngles{0x22, "EulerAngles", 6,
    {{detail::I16("Roll", 0, 1. / 128, "deg"), detail::I16("Pitch", 1, 1. / 128, "deg"),
      detail::I16("Yaw", 2, 1. / 128, "deg")}}};
inline constexpr Layout kRateOfTurn{0x32, "RateOfTurn", 6,
    {{detail::I16("Gyr_X", 0, 1. / 512, "rad/s"), detail::I16("Gyr_Y", 1, 1. / 512, "rad/s"),
      detail::I16("Gyr_Z", 2, 1. / 512, "rad/s")}}};
inline constexpr Layout kAcceleration{0x34, "Acceleration", 6,
    {{detail::I16("Acc_X", 0, 1. / 256, "m/s2"), detail::I16("Acc_Y", 1, 1. / 256, "m/s2"),
      detail::I16("Acc_Z", 2, 1. / 256, "m/s2")}}};
// clang-format on

/// Bits of StatusWord. The self-test bit is not among those an MTi-600 reports.
inline constexpr uint32_t kOrientationValid = 0x02;
/// Of the accelerometer's, the gyroscope's and the magnetometer's first axis; those of the other
/// two follow.
inline constexpr uint32_t kClippedForce = 0x100, kClippedRate = 0x800, kClippedField = 0x4000;
inline constexpr uint32_t kForceAxes = 7 * kClippedForce, kRateAxes = 7 * kClippedRate,
                          kFieldAxes = 7 * kClippedField;
inline constexpr uint32_t kClippingDetected = 0x80000;  ///< on any axis of anything

constexpr Frame Make(const Layout& layout, int base, std::initializer_list<double> values) {
  Frame frame;
  frame.id = layout.command + static_cast<uint32_t>(base);
  EncodePayload(layout, values, frame);
  return frame;
}

}  // namespace plumb::xsens
