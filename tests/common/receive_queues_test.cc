#include "common/receive_queues.h"

#include <sys/stat.h>

#include <catch2/catch.hpp>

#include "common/file_descriptor.h"
#include "tests/common/datagrams.h"

namespace plumb {
namespace {

TEST_CASE("of /proc/net/udp the sockets of one port are read, whatever else stands there") {
  const std::string text =
      "   sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout "
      "inode ref pointer drops             \n"
      " 1234: 434CFFEF:1DF3 00000000:0000 07 00000000:00000300 00:00000000 00000000     0        0 "
      "98765 2 00000000f00dfeed 12         \n"
      " 1235: 00000000:1DF3 00000000:0000 07 00000000:00000000 00:00000000 00000000  1000        0 "
      "98766 2 ffff888012345678 0          \n"
      " 1236: 00000000:1DF4 00000000:0000 07 00000000:00000000 00:00000000 00000000  1000        0 "
      "98767 2 ffff888012345678 0          \n"
      "rubbish\n\n 17: 0000";
  CHECK(ParseReceiveQueues(text, 7667) ==
        std::vector<ReceiveQueue>{{98765, 768, 12}, {98766, 0, 0}});
  CHECK(ParseReceiveQueues("", 7667).empty());
}

TEST_CASE("what waits for a socket, and what it has lost, is seen while it is so") {
  const FileDescriptor fd(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t length = sizeof address;
  REQUIRE(bind(fd.get(), reinterpret_cast<const sockaddr*>(&address), length) == 0);
  REQUIRE(getsockname(fd.get(), reinterpret_cast<sockaddr*>(&address), &length) == 0);
  const uint16_t port = ntohs(address.sin_port);
  const auto ours = [&] {
    struct stat status {};
    REQUIRE(fstat(fd.get(), &status) == 0);
    for (const ReceiveQueue& queue : ReceiveQueues(port)) {
      if (queue.socket == status.st_ino) return queue;
    }
    FAIL("it is not there");
    return ReceiveQueue{};
  };
  CHECK(ours().waiting == 0);
  CHECK(ours().drops == 0);
  const RawSender sender("127.0.0.1", port);
  sender.Send(std::vector<uint8_t>(100));
  CHECK(ours().waiting >= 100);
  for (int i = 0; i < 10'000; ++i) sender.Send(std::vector<uint8_t>(100));
  CHECK(ours().drops > 0);
}

}  // namespace
}  // namespace plumb
