#include "drivers/can/socketcan.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <linux/net_tstamp.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "drivers/can/file_descriptor.h"
#include "drivers/can/receive_control.h"

namespace plumb {
namespace {

/// Kernel form of a frame. @return its size, which is what tells classic and FD frames apart.
size_t ToKernel(const Frame& frame, canfd_frame& out) noexcept {
  out = {};
  out.can_id = frame.id | (frame.extended ? CAN_EFF_FLAG : 0) | (frame.remote ? CAN_RTR_FLAG : 0) |
               (frame.error ? CAN_ERR_FLAG : 0);
  out.len = frame.length;
  if (frame.fd) {
    out.flags = static_cast<uint8_t>((frame.bit_rate_switch ? CANFD_BRS : 0) |
                                     (frame.error_state_indicator ? CANFD_ESI : 0));
  }
  std::ranges::copy(frame.payload(), out.data);
  return frame.fd ? CANFD_MTU : CAN_MTU;
}

/// @return false for a size or length that is no frame's.
bool FromKernel(const canfd_frame& in, size_t size, Frame& frame) noexcept {
  if (size != CAN_MTU && size != CANFD_MTU) return false;
  frame = Frame{};
  frame.fd = size == CANFD_MTU;
  frame.extended = (in.can_id & CAN_EFF_FLAG) != 0;
  frame.remote = (in.can_id & CAN_RTR_FLAG) != 0;
  frame.error = (in.can_id & CAN_ERR_FLAG) != 0;
  if (frame.error) frame.extended = frame.remote = false;
  frame.id = in.can_id & (frame.extended || frame.error ? CAN_EFF_MASK : CAN_SFF_MASK);
  frame.length = in.len;
  if (frame.fd) {
    frame.bit_rate_switch = (in.flags & CANFD_BRS) != 0;
    frame.error_state_indicator = (in.flags & CANFD_ESI) != 0;
  }
  if (!IsWellFormed(frame)) return false;
  std::copy_n(in.data, frame.payload().size(), frame.data.begin());
  return true;
}

class SocketCan : public Transport {
 public:
  SocketCan(const std::string& interface, std::vector<Filter> filters)
      : Transport(std::move(filters)), interface_(interface) {
    if (interface.empty() || interface.size() >= IFNAMSIZ) {
      throw std::runtime_error(fmt::format("socketcan:{}: not an interface name, such as can0", interface));
    }
    // Remote frames of our ids, 29-bit ids with the same low bits: without the flag bits in the mask they
    // pass.
    for (const Filter& filter : filters_) {
      kernel_filters_.push_back(
          {.can_id = filter.id, .can_mask = filter.mask | CAN_EFF_FLAG | (filter.remote ? 0 : CAN_RTR_FLAG)});
    }
    socket_ = OpenSocket();
    switch (socket_.valid() ? 0 : errno) {
      case 0:
        break;
      case EAFNOSUPPORT:
      case EPROTONOSUPPORT:
        Fail("this kernel has no CAN; cure: modprobe can_raw, or use udp:239.74.163.2:43113");
      case ENODEV:
        Fail(fmt::format(
            "no such interface; cure: ip link add {0} type vcan && ip link set {0} up for a virtual "
            "one, or use udp:239.74.163.2:43113",
            interface_));
      case EPROTOTYPE:
        Fail("not a CAN interface");
      default:
        Fail(std::strerror(errno));
    }
    link_ = InterfaceState();
    for (size_t i = 0; i < kBatch; ++i) {
      parts_[i] = {&buffers_[i], sizeof buffers_[i]};
      messages_[i].msg_hdr.msg_iov = &parts_[i];
      messages_[i].msg_hdr.msg_iovlen = 1;
    }
  }

  int fd() const noexcept override { return socket_.get(); }

  int Send(std::span<const Frame> frames) noexcept override {
    size_t sent = 0;
    for (; sent < frames.size(); ++sent) {
      canfd_frame frame;
      const size_t size = ToKernel(frames[sent], frame);
      if (send(socket_.get(), &frame, size, MSG_NOSIGNAL) != static_cast<ssize_t>(size)) {
        OnError(errno);
        break;
      }
    }
    stats_.sent += static_cast<int64_t>(sent);
    stats_.refused += static_cast<int64_t>(frames.size() - sent);
    return static_cast<int>(sent);
  }

  int Receive(std::span<Frame> frames) noexcept override {
    int count = 0;
    // What is not handed out counts, too: a flood of it must not keep us.
    for (size_t left = kMostExamined; left > 0 && static_cast<size_t>(count) < frames.size();) {
      const size_t room = std::min({frames.size() - static_cast<size_t>(count), kBatch, left});
      for (size_t i = 0; i < room; ++i) {
        msghdr& header = messages_[i].msg_hdr;
        header.msg_control = controls_[i].bytes;
        header.msg_controllen = sizeof controls_[i].bytes;
        header.msg_flags = 0;
      }
      const int got = recvmmsg(socket_.get(), messages_.data(), static_cast<unsigned>(room), 0, nullptr);
      if (got < 0) {
        OnError(errno);
        break;
      }
      left -= static_cast<size_t>(got);
      for (int i = 0; i < got; ++i) {
        if (Take(static_cast<size_t>(i), frames[static_cast<size_t>(count)])) ++count;
      }
    }
    stats_.received += count;
    return count;
  }

  LinkState Reopen() noexcept override {
    const LinkState state = InterfaceState();
    // After a removal the old socket is dead, even if an interface of the same name has come: a new socket
    // takes the old one's number.
    if (state != LinkState::kGone && (link_ == LinkState::kGone || InterfaceIndex() != index_)) {
      const FileDescriptor fresh = OpenSocket();
      if (!fresh.valid() || dup3(fresh.get(), socket_.get(), O_CLOEXEC) < 0) return link_ = LinkState::kGone;
    }
    return link_ = state;
  }

 private:
  static constexpr size_t kBatch = 16;

  [[noreturn]] void Fail(const std::string& what) const {
    throw std::runtime_error(fmt::format("socketcan:{}: {}", interface_, what));
  }

  ifreq Request() const noexcept {
    ifreq request{};
    std::memcpy(request.ifr_name, interface_.c_str(), interface_.size());
    return request;
  }
  int InterfaceIndex() const noexcept {
    ifreq request = Request();
    return ioctl(socket_.get(), SIOCGIFINDEX, &request) == 0 ? request.ifr_ifindex : 0;
  }
  LinkState InterfaceState() const noexcept {
    ifreq request = Request();
    if (ioctl(socket_.get(), SIOCGIFFLAGS, &request) != 0) return LinkState::kGone;
    return (request.ifr_flags & IFF_UP) != 0 ? LinkState::kUp : LinkState::kDown;
  }

  /// A bound socket; invalid with errno set on failure.
  FileDescriptor OpenSocket() noexcept {
    FileDescriptor fresh(socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW));
    if (!fresh.valid()) return {};
    const int fd = fresh.get();
    ifreq request = Request();
    // Index 0 would bind to every CAN interface there is.
    if (ioctl(fd, SIOCGIFINDEX, &request) != 0 || request.ifr_ifindex == 0)
      return errno = ENODEV, FileDescriptor();
    const int index = request.ifr_ifindex;
    if (ioctl(fd, SIOCGIFHWADDR, &request) != 0 || request.ifr_hwaddr.sa_family != ARPHRD_CAN) {
      return errno = EPROTOTYPE, FileDescriptor();
    }

    const auto set = [fd](int level, int option, int value) {
      return setsockopt(fd, level, option, &value, sizeof value) == 0;
    };
    // Filters before bind, or frames of others arrive in between.
    if (!kernel_filters_.empty() &&
        setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, kernel_filters_.data(),
                   static_cast<socklen_t>(kernel_filters_.size() * sizeof(can_filter))) != 0) {
      return {};
    }
    // Not lost arbitration, which is normal traffic, nor bus errors, which come in floods.
    set(SOL_CAN_RAW, CAN_RAW_ERR_FILTER,
        CAN_ERR_TX_TIMEOUT | CAN_ERR_CRTL | CAN_ERR_PROT | CAN_ERR_TRX | CAN_ERR_ACK | CAN_ERR_BUSOFF |
            CAN_ERR_RESTARTED | 0x200 /* CAN_ERR_CNT, newer than Debian 12's header */);
    set(SOL_CAN_RAW, CAN_RAW_LOOPBACK, 1);       // candump on this machine sees our commands
    set(SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, 1);  // counted as echoes, not handed out
    set(SOL_CAN_RAW, CAN_RAW_FD_FRAMES, 1);
    // The default receive buffer holds 278 frames: 35 ms of a busy bus.
    if (!set(SOL_SOCKET, SO_RCVBUFFORCE, 4 << 20)) set(SOL_SOCKET, SO_RCVBUF, 4 << 20);
    // The least the kernel allows: about ten frames in flight, then EAGAIN. A long queue of torques would be
    // sent to the motors when a dead bus comes back.
    set(SOL_SOCKET, SO_SNDBUF, 0);
    set(SOL_SOCKET, SO_RXQ_OVFL, 1);
    set(SOL_SOCKET, SO_TIMESTAMPING, SOF_TIMESTAMPING_RX_SOFTWARE | SOF_TIMESTAMPING_SOFTWARE);

    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = index;
    if (bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) return {};
    index_ = index;
    return fresh;
  }

  /// ENETDOWN and ENODEV come once; afterwards a dead socket looks like a quiet bus. So the state is kept.
  void OnError(int error) noexcept {
    if (error == ENETDOWN) link_ = LinkState::kDown;
    if (error == ENODEV || error == ENXIO) link_ = LinkState::kGone;
  }

  bool Take(size_t index, Frame& frame) noexcept {
    const mmsghdr& message = messages_[index];
    const ReceiveControl control = ReadControl(message.msg_hdr);
    if (control.overflow) stats_.lost = *control.overflow;
    if ((message.msg_hdr.msg_flags & MSG_CONFIRM) != 0) {
      ++stats_.echoes;
      return false;
    }
    if (!FromKernel(buffers_[index], message.msg_len, frame)) {
      ++stats_.malformed;
      return false;
    }
    frame.receive_ns = control.receive_ns;
    return true;
  }

  std::string interface_;
  int index_ = 0;
  std::vector<can_filter> kernel_filters_;
  FileDescriptor socket_;
  std::array<canfd_frame, kBatch> buffers_;
  std::array<ControlBuffer, kBatch> controls_;
  std::array<iovec, kBatch> parts_;
  std::array<mmsghdr, kBatch> messages_{};
};

}  // namespace

std::unique_ptr<Transport> OpenSocketCan(const std::string& interface, std::vector<Filter> filters) {
  return std::make_unique<SocketCan>(interface, std::move(filters));
}

}  // namespace plumb
