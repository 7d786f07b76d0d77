#pragma once

#include "drivers/protocols/fields.h"

/// CANopen absolute encoders: CiA 301 (NMT, heartbeat, emergency, SDO, PDO) as far as the device
/// profile CiA 406 needs it. Identifiers are those of the predefined connection set, little-endian.
/// Object numbers as in the profile: 6004h is the position, an unsigned 32-bit number of counts,
/// and TPDO1 carries it, alone. The specifications are CAN in Automation's; layouts as printed in
/// the manuals of Lika, SICK and Kuebler. Thread-safe: constants and pure functions.
namespace plumb::cia406 {

// clang-format off
namespace detail {
constexpr Field U(std::string_view name, int bit, int bits, std::string_view unit = "") {
  return {name, static_cast<uint8_t>(bit), static_cast<uint8_t>(bits), Field::Kind::kUnsigned, 1,
          unit};
}
}  // namespace detail

// `command` is the function code: the id is that plus the node.
inline constexpr Layout kNmt{
    0x000, "NMT", 2, {{detail::U("Command", 0, 8), detail::U("Node", 8, 8)}}};
inline constexpr Layout kEmergency{0x080, "EMCY", 8,
    {{detail::U("Error_Code", 0, 16), detail::U("Error_Register", 16, 8),
      detail::U("Manufacturer", 24, 40)}}};
inline constexpr Layout kPosition{0x180, "TPDO1", 4, {{detail::U("Position", 0, 32)}}};
inline constexpr Layout kSdoAnswer{0x580, "SDO_Answer", 8,
    {{detail::U("Specifier", 0, 8), detail::U("Index", 8, 16), detail::U("Subindex", 24, 8),
      detail::U("Data", 32, 32)}}};
inline constexpr Layout kSdoRequest{0x600, "SDO_Request", 8,
    {{detail::U("Specifier", 0, 8), detail::U("Index", 8, 16), detail::U("Subindex", 24, 8),
      detail::U("Data", 32, 32)}}};
inline constexpr Layout kHeartbeat{0x700, "Heartbeat", 1, {{detail::U("State", 0, 8)}}};
// clang-format on

enum NmtCommand : uint8_t { kStart = 0x01, kStop = 0x02, kPreOperational = 0x80, kReset = 0x81 };
enum NmtState : uint8_t {
  kBootUp = 0x00,
  kStopped = 0x04,
  kOperational = 0x05,
  kInPreOperational = 0x7F
};
/// Of a download of 2 or 4 bytes in one frame, and the answers to it.
enum SdoSpecifier : uint8_t { kWrite4 = 0x23, kWrite2 = 0x2B, kWritten = 0x60, kAbort = 0x80 };

inline constexpr int kPdoParameter = 0x1800;  ///< of TPDO1
inline constexpr int kEventTimer = 5;         ///< its subindex: [ms] between two of them
/// makes the present position that. We never write it
inline constexpr int kPreset = 0x6003;

/// A data frame, values in the order of the layout's fields. NMT has no node in its id.
constexpr Frame Make(const Layout& layout, int node, std::initializer_list<double> values) {
  Frame frame;
  frame.id = layout.command + (layout.command == kNmt.command ? 0u : static_cast<uint32_t>(node));
  EncodePayload(layout, values, frame);
  return frame;
}

}  // namespace plumb::cia406
