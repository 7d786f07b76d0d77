#include "common/own_machine.h"

#include <linux/filter.h>
#include <linux/if_packet.h>
#include <net/if.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <system_error>

namespace plumb {

// What this machine has sent comes by the loopback interface or, where multicast is routed to
// another one, as that one's looped back copy. From outside comes neither.
void AdmitOwnMachineOnly(int fd) {
  const auto loopback = if_nametoindex("lo");
  constexpr auto kField = [](int field) { return static_cast<uint32_t>(SKF_AD_OFF + field); };
  std::array<sock_filter, 6> program{{
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, kField(SKF_AD_IFINDEX)),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, loopback, 2, 0),
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, kField(SKF_AD_PKTTYPE)),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, PACKET_LOOPBACK, 0, 1),
      BPF_STMT(BPF_RET | BPF_K, 0xffffffff),
      BPF_STMT(BPF_RET | BPF_K, 0),
  }};
  const sock_fprog filter{static_cast<unsigned short>(program.size()), program.data()};
  if (setsockopt(fd, SOL_SOCKET, SO_ATTACH_FILTER, &filter, sizeof filter) != 0)
    throw std::system_error(errno, std::generic_category(),
                            "cannot keep out what comes from other machines");
}

}  // namespace plumb
