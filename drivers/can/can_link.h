#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace plumb {

/// Whether this kernel gives a process raw CAN sockets: without them there is no SocketCAN.
/// Thread-safe.
bool KernelHasCan() noexcept;

/// How a CAN interface is set up, as far as its kind tells (vcan has no bit rate, nor restarts).
struct CanLink {
  std::string kind;  ///< "can", "vcan", "vxcan"
  /// [ms] after bus-off until the controller tries again; 0 = never
  std::optional<uint32_t> restart_ms;
  std::optional<uint32_t> bit_rate;  ///< [bit/s]
};

/// Asks the kernel (RTM_GETLINK); needs no privilege. @return nothing if it does not answer.
std::optional<CanLink> ReadCanLink(int interface_index);

/// Reads the kernel's answer. @return nothing if that is not one RTM_NEWLINK message. Thread-safe.
std::optional<CanLink> ParseCanLink(std::span<const uint8_t> message);

}  // namespace plumb
