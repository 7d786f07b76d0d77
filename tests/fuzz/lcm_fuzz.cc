// libFuzzer: whatever datagrams say, what is put together of them is a message, and what is kept
// has its bound.

#include "common/lcm_datagrams.h"

#include "tests/fuzz/bytes.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  LcmDatagrams datagrams([](std::string_view channel) { return !channel.starts_with("UN"); });
  // One after the other, each behind its sender and its length, so that fragments may follow.
  for (std::span<const uint8_t> rest(data, size); rest.size() >= 2;) {
    const uint64_t sender = rest[0] % 4;
    const auto datagram = rest.subspan(2).first(std::min<size_t>(rest[1], rest.size() - 2));
    rest = rest.subspan(2 + datagram.size());
    const auto message = datagrams.Take(sender, datagram);
    Require(datagrams.pending() <= size_t{16} << 20);
    if (!message) continue;
    Require(message->channel.size() <= 63 && !message->channel.starts_with("UN"));
    Require(message->data.size() <= size);
    volatile uint8_t seen = 0;  // each byte can be read
    for (const uint8_t byte : message->data) seen = seen ^ byte;
  }
  return 0;
}
