#include "drivers/can/udp.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <stdexcept>

#include "drivers/can/file_descriptor.h"
#include "drivers/can/receive_control.h"
#include "drivers/can/udp_codec.h"

namespace plumb {
namespace {

sockaddr_in ParseAddress(const std::string& address) {
  sockaddr_in result{};
  result.sin_family = AF_INET;
  const auto colon = address.rfind(':');
  uint16_t port = 0;
  if (colon != std::string::npos) {
    const char* end = address.data() + address.size();
    const auto parsed = std::from_chars(address.data() + colon + 1, end, port);
    if (parsed.ec != std::errc{} || parsed.ptr != end) port = 0;
  }
  if (port == 0 || inet_pton(AF_INET, address.substr(0, colon).c_str(), &result.sin_addr) != 1 ||
      !IN_MULTICAST(ntohl(result.sin_addr.s_addr))) {
    throw std::runtime_error(fmt::format(
        "udp:{}: not an IPv4 multicast group and a port, such as udp:239.74.163.2:43113", address));
  }
  result.sin_port = htons(port);
  return result;
}

template <class Value>
bool SetOption(int fd, int level, int option, const Value& value) {
  return setsockopt(fd, level, option, &value, sizeof value) == 0;
}

class Udp : public Transport {
 public:
  Udp(const std::string& address, std::vector<Filter> filters)
      : Transport(std::move(filters)), url_("udp:" + address), group_(ParseAddress(address)) {
    receiver_ = FileDescriptor(socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    sender_ = FileDescriptor(socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    if (!receiver_.valid() || !sender_.valid()) Fail("cannot create a socket");
    const int in = receiver_.get(), out = sender_.get();
    SetOption(in, SOL_SOCKET, SO_REUSEADDR, 1);
    SetOption(in, SOL_SOCKET, SO_REUSEPORT, 1);
    SetOption(in, SOL_SOCKET, SO_RCVBUF, 4 << 20);
    SetOption(in, SOL_SOCKET, SO_RXQ_OVFL, 1);
    SetOption(in, SOL_SOCKET, SO_TIMESTAMPNS, 1);
    // Without this a socket hears every group that anybody on the machine has joined.
    SetOption(in, IPPROTO_IP, IP_MULTICAST_ALL, 0);
    if (bind(in, reinterpret_cast<const sockaddr*>(&group_), sizeof group_) != 0)
      Fail("cannot bind the port");

    // The interface that the routes choose, as python-can does; where no route leads, the loopback.
    ip_mreqn membership{};
    membership.imr_multiaddr = group_.sin_addr;
    if (!SetOption(in, IPPROTO_IP, IP_ADD_MEMBERSHIP, membership)) {
      membership.imr_ifindex = static_cast<int>(if_nametoindex("lo"));
      if (!SetOption(in, IPPROTO_IP, IP_ADD_MEMBERSHIP, membership) ||
          !SetOption(out, IPPROTO_IP, IP_MULTICAST_IF, membership)) {
        Fail("no interface for multicast; cure: ip link set lo up");
      }
    }
    SetOption(out, IPPROTO_IP, IP_MULTICAST_TTL, 0);
    SetOption(out, IPPROTO_IP, IP_MULTICAST_LOOP, 1);
    if (connect(out, reinterpret_cast<const sockaddr*>(&group_), sizeof group_) != 0) {
      Fail("no route for multicast; cure: ip link set lo up multicast on && ip route add 239.0.0.0/8 dev lo");
    }
    // Our own datagrams come back to us; this source address tells them from others'.
    socklen_t length = sizeof own_;
    getsockname(out, reinterpret_cast<sockaddr*>(&own_), &length);
    for (size_t i = 0; i < kBatch; ++i) {
      parts_[i] = {buffers_[i].data(), buffers_[i].size()};
      messages_[i].msg_hdr.msg_iov = &parts_[i];
      messages_[i].msg_hdr.msg_iovlen = 1;
    }
  }

  int fd() const noexcept override { return receiver_.get(); }

  int Send(std::span<const Frame> frames) noexcept override {
    timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    const double timestamp = static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
    std::array<uint8_t, kMaxUdpDatagram> datagram;
    size_t sent = 0;
    for (; sent < frames.size(); ++sent) {
      const size_t size = EncodeUdp(frames[sent], timestamp, datagram);
      if (send(sender_.get(), datagram.data(), size, MSG_NOSIGNAL) != static_cast<ssize_t>(size)) {
        if (errno == ENETDOWN || errno == ENETUNREACH || errno == ENODEV) link_ = LinkState::kDown;
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
        header.msg_name = &sources_[i];
        header.msg_namelen = sizeof sources_[i];
        header.msg_control = controls_[i].bytes;
        header.msg_controllen = sizeof controls_[i].bytes;
        header.msg_flags = 0;
      }
      const int got = recvmmsg(receiver_.get(), messages_.data(), static_cast<unsigned>(room), 0, nullptr);
      if (got <= 0) break;
      left -= static_cast<size_t>(got);
      for (int i = 0; i < got; ++i) {
        if (Take(static_cast<size_t>(i), frames[static_cast<size_t>(count)])) ++count;
      }
    }
    stats_.received += count;
    return count;
  }

  LinkState Reopen() noexcept override {
    // Nothing tells us that a route is back except sending: the next Send finds out.
    return link_ = LinkState::kUp;
  }

 private:
  static constexpr size_t kBatch = 16;

  [[noreturn]] void Fail(const char* what) const {
    throw std::runtime_error(fmt::format("{}: {} ({})", url_, what, std::strerror(errno)));
  }

  bool Take(size_t index, Frame& frame) noexcept {
    const mmsghdr& message = messages_[index];
    const ReceiveControl control = ReadControl(message.msg_hdr);
    if (control.overflow) stats_.lost = *control.overflow;
    const sockaddr_in& source = sources_[index];
    if (source.sin_port == own_.sin_port && source.sin_addr.s_addr == own_.sin_addr.s_addr) {
      ++stats_.echoes;
      return false;
    }
    if ((message.msg_hdr.msg_flags & MSG_TRUNC) != 0 ||
        !DecodeUdp(std::span(buffers_[index]).first(message.msg_len), frame)) {
      ++stats_.malformed;
      return false;
    }
    frame.receive_ns = control.receive_ns;
    return Passes(frame);
  }

  std::string url_;
  sockaddr_in group_;
  sockaddr_in own_{};
  FileDescriptor receiver_, sender_;
  std::array<std::array<uint8_t, kMaxUdpDatagram>, kBatch> buffers_;
  std::array<ControlBuffer, kBatch> controls_;
  std::array<sockaddr_in, kBatch> sources_;
  std::array<iovec, kBatch> parts_;
  std::array<mmsghdr, kBatch> messages_{};
};

}  // namespace

std::unique_ptr<Transport> OpenUdp(const std::string& address, std::vector<Filter> filters) {
  return std::make_unique<Udp>(address, std::move(filters));
}

}  // namespace plumb
