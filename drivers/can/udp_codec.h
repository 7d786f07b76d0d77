#pragma once

#include <cstdint>
#include <span>

#include "drivers/can/frame.h"

namespace plumb {

/// Largest datagram of the format, with room for the longest FD frame. Functions are thread-safe.
inline constexpr size_t kMaxUdpDatagram = 512;

/// Writes one frame as python-can's "udp_multicast" does: one msgpack map of 11 keys.
/// @param timestamp [s] CLOCK_REALTIME; receivers replace it by their own.
/// @param datagram at least kMaxUdpDatagram bytes.
/// @return its length in bytes.
size_t EncodeUdp(const Frame& frame, double timestamp, std::span<uint8_t> datagram) noexcept;

/// Reads one datagram, strictly: all eleven keys once each in any order, nothing else and nothing
/// after, a well-formed frame, dlc equal to the number of data bytes (none in a remote frame).
/// @return false, with `frame` unspecified, for anything else.
bool DecodeUdp(std::span<const uint8_t> datagram, Frame& frame) noexcept;

}  // namespace plumb
