#include "drivers/can/can_link.h"

#include <linux/can.h>
#include <linux/can/netlink.h>
#include <linux/can/raw.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "common/file_descriptor.h"

namespace plumb {
namespace {

using Bytes = std::span<const uint8_t>;

template <class Value>
std::optional<Value> Read(Bytes bytes) {
  if (bytes.size() < sizeof(Value)) return {};
  Value value;
  std::memcpy(&value, bytes.data(), sizeof value);
  return value;
}

/// The payload of the first attribute of that type among those that fill the bytes; empty if there
/// is none.
Bytes Attribute(Bytes bytes, int type) {
  while (const auto header = Read<rtattr>(bytes)) {
    if (header->rta_len < sizeof(rtattr) || header->rta_len > bytes.size()) break;
    if ((header->rta_type & NLA_TYPE_MASK) == type) {
      return bytes.subspan(sizeof(rtattr), header->rta_len - sizeof(rtattr));
    }
    bytes = bytes.subspan(std::min<size_t>(RTA_ALIGN(header->rta_len), bytes.size()));
  }
  return {};
}

}  // namespace

bool KernelHasCan() noexcept {
  return FileDescriptor(socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW)).valid();
}

std::optional<CanLink> ParseCanLink(Bytes message) {
  const auto header = Read<nlmsghdr>(message);
  constexpr size_t kAttributes = NLMSG_HDRLEN + NLMSG_ALIGN(sizeof(ifinfomsg));
  if (!header || header->nlmsg_type != RTM_NEWLINK || header->nlmsg_len > message.size() ||
      header->nlmsg_len < kAttributes) {
    return {};
  }
  const Bytes info =
      Attribute(message.subspan(kAttributes, header->nlmsg_len - kAttributes), IFLA_LINKINFO);
  const Bytes kind = Attribute(info, IFLA_INFO_KIND);
  const Bytes data = Attribute(info, IFLA_INFO_DATA);
  CanLink link;
  if (!kind.empty()) {
    link.kind.assign(reinterpret_cast<const char*>(kind.data()),
                     strnlen(reinterpret_cast<const char*>(kind.data()), kind.size()));
  }
  if (link.kind != "can") return link;  // others number their attributes otherwise
  link.restart_ms = Read<uint32_t>(Attribute(data, IFLA_CAN_RESTART_MS));
  if (const auto timing = Read<can_bittiming>(Attribute(data, IFLA_CAN_BITTIMING))) {
    link.bit_rate = timing->bitrate;
  }
  return link;
}

std::optional<CanLink> ReadCanLink(int interface_index) {
  const FileDescriptor netlink(socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE));
  struct {
    nlmsghdr header;
    ifinfomsg interface;
  } request{};
  request.header.nlmsg_len = sizeof request;
  request.header.nlmsg_type = RTM_GETLINK;
  request.header.nlmsg_flags = NLM_F_REQUEST;
  request.interface.ifi_index = interface_index;
  // The kernel answers at once, within the call of send.
  std::array<uint8_t, 16384> answer;
  if (!netlink.valid() || send(netlink.get(), &request, sizeof request, 0) != sizeof request)
    return {};
  const ssize_t size = recv(netlink.get(), answer.data(), answer.size(), MSG_DONTWAIT);
  if (size <= 0) return {};
  return ParseCanLink(Bytes(answer).first(static_cast<size_t>(size)));
}

}  // namespace plumb
