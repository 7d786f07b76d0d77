#include "drivers/can/can_link.h"

#include <linux/can/netlink.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>

#include <catch2/catch.hpp>
#include <cstring>
#include <vector>

namespace plumb {
namespace {

using Bytes = std::vector<uint8_t>;

template <class Value>
Bytes Raw(const Value& value) {
  Bytes bytes(sizeof value);
  std::memcpy(bytes.data(), &value, sizeof value);
  return bytes;
}

Bytes Attribute(int type, const Bytes& payload) {
  Bytes bytes = Raw(
      rtattr{static_cast<uint16_t>(sizeof(rtattr) + payload.size()), static_cast<uint16_t>(type)});
  bytes.insert(bytes.end(), payload.begin(), payload.end());
  bytes.resize((bytes.size() + 3) / 4 * 4);
  return bytes;
}

Bytes operator+(Bytes a, const Bytes& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

/// The kernel's answer on an interface of some kind with restart-ms 100 and 1 Mbit/s.
Bytes Message(const char* kind) {
  can_bittiming timing{};
  timing.bitrate = 1'000'000;
  const Bytes data = Attribute(IFLA_CAN_BITTIMING, Raw(timing)) +
                     Attribute(IFLA_CAN_RESTART_MS, Raw(uint32_t{100}));
  const Bytes name(kind, kind + std::strlen(kind) + 1);
  const Bytes info =
      Attribute(IFLA_INFO_KIND, name) + Attribute(IFLA_INFO_DATA | NLA_F_NESTED, data);
  Bytes message = Raw(nlmsghdr{}) + Raw(ifinfomsg{}) + Attribute(IFLA_TXQLEN, Raw(uint32_t{10})) +
                  Attribute(IFLA_IFNAME, {'c', 'a', 'n', '0', 0}) + Attribute(IFLA_LINKINFO, info);
  nlmsghdr header{};
  header.nlmsg_type = RTM_NEWLINK;
  header.nlmsg_len = static_cast<uint32_t>(message.size());
  std::memcpy(message.data(), &header, sizeof header);
  return message;
}

TEST_CASE("the kernel's answer about a CAN interface is read") {
  const auto link = ParseCanLink(Message("can"));
  REQUIRE(link);
  CHECK(link->kind == "can");
  CHECK(link->restart_ms == 100u);
  CHECK(link->bit_rate == 1'000'000u);
}

TEST_CASE("other kinds of interface number their attributes otherwise") {
  const auto link = ParseCanLink(Message("vxcan"));
  REQUIRE(link);
  CHECK(link->kind == "vxcan");
  CHECK_FALSE(link->restart_ms);
  CHECK_FALSE(link->bit_rate);
}

TEST_CASE("an answer that is cut short is no answer, and lengths that lie lead nowhere") {
  const Bytes whole = Message("can");
  for (size_t size = 0; size < whole.size(); ++size) {
    CHECK_FALSE(ParseCanLink(std::span(whole).first(size)));
  }
  for (size_t i = sizeof(nlmsghdr); i < whole.size(); ++i) {
    for (const uint8_t byte : {0x00, 0x01, 0x7F, 0xFF}) {
      Bytes changed = whole;
      changed[i] = byte;
      ParseCanLink(changed);  // for the sanitizers
    }
  }
}

}  // namespace
}  // namespace plumb
