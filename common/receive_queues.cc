#include "common/receive_queues.h"

#include <cinttypes>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>

namespace plumb {

std::vector<ReceiveQueue> ReceiveQueues(uint16_t port) {
  std::ifstream stream("/proc/net/udp");
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  return ParseReceiveQueues(text, port);
}

// sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode
// ref pointer drops; proc_net_udp(5) has it as part of proc(5).
std::vector<ReceiveQueue> ParseReceiveQueues(std::string_view text, uint16_t port) {
  std::vector<ReceiveQueue> queues;
  std::istringstream lines{std::string(text)};
  for (std::string line; std::getline(lines, line);) {
    unsigned local_port = 0;
    size_t waiting = 0;
    uint64_t inode = 0, drops = 0;
    const int read = std::sscanf(line.c_str(),
                                 " %*d: %*8x:%4x %*8x:%*4x %*2x %*8x:%8zx %*2x:%*8x %*8x %*u %*u "
                                 "%" SCNu64 " %*d %*s %" SCNu64,
                                 &local_port, &waiting, &inode, &drops);
    if (read == 4 && local_port == port) queues.push_back({inode, waiting, drops});
  }
  return queues;
}

}  // namespace plumb
