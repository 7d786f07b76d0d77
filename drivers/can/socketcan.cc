#include "drivers/can/socketcan.h"

#include <fmt/format.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <linux/net_tstamp.h>
#include <linux/netlink.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <sys/epoll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "common/file_descriptor.h"
#include "drivers/can/can_link.h"
#include "drivers/can/datagram_transport.h"
#include "drivers/can/error_frame.h"

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
bool FromKernel(std::span<const uint8_t> datagram, Frame& frame) noexcept {
  if (datagram.size() != CAN_MTU && datagram.size() != CANFD_MTU) return false;
  canfd_frame in{};
  std::ranges::copy(datagram, reinterpret_cast<uint8_t*>(&in));
  frame = Frame{};
  frame.fd = datagram.size() == CANFD_MTU;
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

class SocketCan : public DatagramTransport {
 public:
  SocketCan(const std::string& interface, std::vector<Filter> filters)
      : DatagramTransport(std::move(filters)), interface_(interface) {
    if (interface.empty() || interface.size() >= IFNAMSIZ) {
      throw std::runtime_error(
          fmt::format("socketcan:{}: not an interface name, such as can0", interface));
    }
    // Remote frames of our ids, 29-bit ids with the same low bits: without the flag bits in the
    // mask they pass.
    for (const Filter& filter : filters_) {
      kernel_filters_.push_back(
          {.can_id = filter.id | (filter.extended ? CAN_EFF_FLAG : 0),
           .can_mask = filter.mask | CAN_EFF_FLAG | (filter.remote ? 0 : CAN_RTR_FLAG)});
    }
    epoll_ = FileDescriptor(epoll_create1(EPOLL_CLOEXEC));
    socket_ = OpenSocket();
    switch (socket_.valid() ? 0 : errno) {
      case 0:
        break;
      case EAFNOSUPPORT:
      case EPROTONOSUPPORT:
        Fail("this kernel has no CAN; cure: modprobe can_raw, or use udp:239.74.163.2:43113");
      case ENODEV:
        Fail(
            fmt::format("no such interface; cure: ip link add {0} type vcan && ip link set {0} up "
                        "for a virtual one, or use udp:239.74.163.2:43113",
                        interface_));
      case EPROTOTYPE:
        Fail("not a CAN interface");
      default:
        Fail(std::strerror(errno));
    }
    WatchLinks();
    link_ = InterfaceState();
    AddWarnings();
  }

  int fd() const noexcept override { return epoll_.get(); }
  // One that is away may come back with it.
  bool carries_fd() const noexcept override {
    ifreq request = Request();
    return ioctl(socket_.get(), SIOCGIFMTU, &request) != 0 || request.ifr_mtu != CAN_MTU;
  }

  LinkState Reopen() noexcept override {
    const LinkState state = InterfaceState();
    // After a removal the old socket is dead, even if an interface of the same name has come, and
    // binding it again does not bring its filters back: a new one takes its place.
    if (state != LinkState::kGone && (link_ == LinkState::kGone || InterfaceIndex() != index_)) {
      FileDescriptor fresh = OpenSocket();
      if (!fresh.valid()) return link_ = LinkState::kGone;
      std::swap(socket_, fresh);
      NoteNewReceiver();
    }
    if (link_ != LinkState::kUp) bus_off_ = false;  // down and up has restarted the controller
    return link_ = state;
  }

 private:
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
        CAN_ERR_TX_TIMEOUT | CAN_ERR_CRTL | CAN_ERR_PROT | CAN_ERR_TRX | CAN_ERR_ACK |
            CAN_ERR_BUSOFF | CAN_ERR_RESTARTED |
            0x200 /* CAN_ERR_CNT, newer than Debian 12's header */);
    set(SOL_CAN_RAW, CAN_RAW_LOOPBACK, 1);       // candump on this machine sees our commands
    set(SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, 1);  // counted as echoes, not handed out
    set(SOL_CAN_RAW, CAN_RAW_FD_FRAMES, 1);
    // The default receive buffer holds 278 frames: 35 ms of a busy bus. Beyond rmem_max needs
    // CAP_NET_ADMIN.
    if (!set(SOL_SOCKET, SO_RCVBUFFORCE, kReceiveBuffer))
      set(SOL_SOCKET, SO_RCVBUF, kReceiveBuffer);
    // The least the kernel allows: about ten frames in flight, then EAGAIN. A long queue of torques
    // would be sent to the motors when a dead bus comes back.
    set(SOL_SOCKET, SO_SNDBUF, 0);
    set(SOL_SOCKET, SO_RXQ_OVFL, 1);
    set(SOL_SOCKET, SO_TIMESTAMPING, SOF_TIMESTAMPING_RX_SOFTWARE | SOF_TIMESTAMPING_SOFTWARE);

    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = index;
    if (bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 || !Watch(fd))
      return {};
    index_ = index;
    return fresh;
  }

  bool Watch(int fd) noexcept {
    epoll_event event{.events = EPOLLIN, .data = {.fd = fd}};
    return epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, fd, &event) == 0;
  }

  /// The kernel's notes on interfaces that come, go and change. Without them only Reopen finds out.
  void WatchLinks() {
    links_ =
        FileDescriptor(socket(AF_NETLINK, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, NETLINK_ROUTE));
    sockaddr_nl address{};
    address.nl_family = AF_NETLINK;
    address.nl_groups = RTMGRP_LINK;
    if (!links_.valid() ||
        bind(links_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
        !Watch(links_.get())) {
      links_ = FileDescriptor();
    }
  }

  /// True if there have been notes. What they say does not matter: the interface itself is looked
  /// at.
  bool LinksChanged() noexcept {
    bool changed = false;
    char any;
    for (int i = 0; i < kMaxNotes; ++i) {
      if (recv(links_.get(), &any, sizeof any, MSG_TRUNC) < 0 && errno != ENOBUFS) break;
      changed = true;
    }
    return changed;
  }

  void AddWarnings() {
    const auto link = ReadCanLink(index_);
    if (link && link->restart_ms == 0u) {
      warnings_.push_back(fmt::format(
          "socketcan:{0}: restart-ms is 0: once bus-off, the controller stays off; cure: ip link "
          "set {0} down && "
          "ip link set {0} type can restart-ms 100 && ip link set {0} up",
          interface_));
    }
    int bytes = 0;
    socklen_t size = sizeof bytes;
    getsockopt(socket_.get(), SOL_SOCKET, SO_RCVBUF, &bytes, &size);
    if (bytes < kReceiveBuffer) {
      warnings_.push_back(
          fmt::format("socketcan:{}: the receive buffer holds about {} frames only; cure: sysctl "
                      "-w net.core.rmem_max={}",
                      interface_, bytes / kBytesPerFrame, kReceiveBuffer));
    }
  }

  int sender() const noexcept override { return socket_.get(); }
  int receiver() const noexcept override { return socket_.get(); }
  bool may_send() const noexcept override { return !bus_off_; }

  size_t Encode(const Frame& frame, std::span<uint8_t> datagram) noexcept override {
    canfd_frame out;
    const size_t size = ToKernel(frame, out);
    std::memcpy(datagram.data(), &out, size);
    return size;
  }
  bool Decode(std::span<const uint8_t> datagram, Frame& frame) noexcept override {
    if (!FromKernel(datagram, frame)) return false;
    const BusEvent event = DecodeErrorFrame(frame);
    // Who hears a frame is on the bus.
    if (event == BusEvent::kRestarted || !frame.error) bus_off_ = false;
    if (event == BusEvent::kBusOff) bus_off_ = true;
    return true;
  }
  bool IsEcho(const Datagram& datagram) const noexcept override {
    return (datagram.flags & MSG_CONFIRM) != 0;  // sent by this very socket
  }

  /// ENETDOWN and ENODEV come once; afterwards a dead socket looks like a quiet bus. So the state
  /// is kept.
  void OnSendError(int error) noexcept override {
    if (error == ENETDOWN) link_ = LinkState::kDown;
    if (error == ENODEV || error == ENXIO) link_ = LinkState::kGone;
  }
  void OnReceiveError(int error) noexcept override {
    OnSendError(error);
    // Not before the socket has told that it failed: who asks for link() must see that the bus was
    // away.
    if (error == EAGAIN && links_.valid() && LinksChanged()) Reopen();
  }

  static constexpr int kMaxNotes = 64;            // read in one go
  static constexpr int kReceiveBuffer = 4 << 20;  // bytes
  static constexpr int kBytesPerFrame = 766;      // of it; measured: 278 frames in 212992 bytes

  std::string interface_;
  int index_ = 0;
  bool bus_off_ = false;
  std::vector<can_filter> kernel_filters_;
  FileDescriptor epoll_, links_, socket_;
};

}  // namespace

std::unique_ptr<Transport> OpenSocketCan(const std::string& interface,
                                         std::vector<Filter> filters) {
  return std::make_unique<SocketCan>(interface, std::move(filters));
}

}  // namespace plumb
