#include "drivers/can/udp.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <time.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <stdexcept>

#include "common/file_descriptor.h"
#include "common/own_machine.h"
#include "drivers/can/datagram_transport.h"
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
    // One bus has one name, by which it is locked.
    if (parsed.ec != std::errc{} || parsed.ptr != end || address[colon + 1] == '0') port = 0;
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

class Udp : public DatagramTransport {
 public:
  Udp(const std::string& address, std::vector<Filter> filters, bool told_time)
      : DatagramTransport(std::move(filters)),
        url_("udp:" + address),
        group_(ParseAddress(address)),
        told_time_(told_time) {
    receiver_ = FileDescriptor(socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    sender_ = FileDescriptor(socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    if (!receiver_.valid() || !sender_.valid()) Fail("cannot create a socket");
    const int in = receiver_.get(), out = sender_.get();
    SetOption(in, SOL_SOCKET, SO_REUSEADDR, 1);
    SetOption(in, SOL_SOCKET, SO_REUSEPORT, 1);
    SetOption(in, SOL_SOCKET, SO_RCVBUF, 4 << 20);
    SetOption(in, SOL_SOCKET, SO_RXQ_OVFL, 1);
    SetOption(in, SOL_SOCKET, SO_TIMESTAMPNS, 1);
    // The bus is this machine's, as what we send is: nobody outside has a place on it, wherever
    // multicast is routed.
    AdmitOwnMachineOnly(in);
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
      Fail(
          "no route for multicast; cure: ip link set lo up multicast on && ip route add "
          "239.0.0.0/8 dev lo");
    }
    // Our own datagrams come back to us; this source address tells them from others'.
    socklen_t length = sizeof own_;
    getsockname(out, reinterpret_cast<sockaddr*>(&own_), &length);
  }

  int fd() const noexcept override { return receiver_.get(); }
  void SetTime(int64_t now) noexcept override { now_ = now; }

  LinkState Reopen() noexcept override {
    // Nothing tells us that a route is back except sending: the next Send finds out.
    return link_ = LinkState::kUp;
  }

 private:
  static_assert(kMaxUdpDatagram <= kMaxDatagram);

  [[noreturn]] void Fail(const char* what) const {
    throw std::runtime_error(fmt::format("{}: {} ({})", url_, what, std::strerror(errno)));
  }

  int sender() const noexcept override { return sender_.get(); }
  int receiver() const noexcept override { return receiver_.get(); }

  size_t Encode(const Frame& frame, std::span<uint8_t> datagram) noexcept override {
    if (told_time_) return EncodeUdp(frame, 1e-6 * static_cast<double>(now_), datagram);
    timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    const double timestamp =
        static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
    return EncodeUdp(frame, timestamp, datagram);
  }
  bool Decode(std::span<const uint8_t> datagram, Frame& frame) noexcept override {
    return DecodeUdp(datagram, frame);
  }
  bool IsEcho(const Datagram& datagram) const noexcept override {
    return datagram.source.sin_port == own_.sin_port &&
           datagram.source.sin_addr.s_addr == own_.sin_addr.s_addr;
  }
  void OnSendError(int error) noexcept override {
    if (error == ENETDOWN || error == ENETUNREACH || error == ENODEV) link_ = LinkState::kDown;
  }
  void OnReceiveError(int) noexcept override {}

  std::string url_;
  sockaddr_in group_;
  bool told_time_;   // datagrams are dated with the time of SetTime, not with the machine's
  int64_t now_ = 0;  // of SetTime [us]
  sockaddr_in own_{};
  FileDescriptor receiver_, sender_;
};

}  // namespace

std::unique_ptr<Transport> OpenUdp(const std::string& address, std::vector<Filter> filters,
                                   bool told_time) {
  return std::make_unique<Udp>(address, std::move(filters), told_time);
}

}  // namespace plumb
