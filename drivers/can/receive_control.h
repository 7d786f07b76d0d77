#pragma once

#include <sys/socket.h>
#include <time.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>

namespace plumb {

/// Room for what the kernel says about a received datagram. Thread-safe.
struct ControlBuffer {
  alignas(cmsghdr) char bytes[256];
};

/// The answer.
struct ReceiveControl {
  int64_t receive_ns = 0;  ///< CLOCK_REALTIME of arrival in the kernel; 0 = not stamped
  /// datagrams this socket has lost since it was opened (SO_RXQ_OVFL)
  std::optional<int64_t> overflow;
};

inline ReceiveControl ReadControl(const msghdr& message) noexcept {
  const auto nanoseconds = [](const timespec& t) {
    return int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec;
  };
  ReceiveControl result;
  msghdr& header = const_cast<msghdr&>(message);  // CMSG_NXTHDR wants it so
  for (cmsghdr* control = CMSG_FIRSTHDR(&header); control;
       control = CMSG_NXTHDR(&header, control)) {
    if (control->cmsg_level != SOL_SOCKET) continue;
    if (control->cmsg_type == SO_TIMESTAMPNS) {
      timespec stamp;
      std::memcpy(&stamp, CMSG_DATA(control), sizeof stamp);
      result.receive_ns = nanoseconds(stamp);
    } else if (control->cmsg_type == SO_TIMESTAMPING) {
      timespec stamps[3];  // software, unused, adapter's clock: which is not CLOCK_REALTIME
      std::memcpy(stamps, CMSG_DATA(control), sizeof stamps);
      result.receive_ns = nanoseconds(stamps[0]);
    } else if (control->cmsg_type == SO_RXQ_OVFL) {
      uint32_t lost;
      std::memcpy(&lost, CMSG_DATA(control), sizeof lost);
      result.overflow = lost;
    }
  }
  return result;
}

}  // namespace plumb
