// libFuzzer: any datagram is refused, or is a well-formed frame that survives being sent on.

#include <array>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "drivers/can/udp_codec.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  Frame frame;
  if (!DecodeUdp({data, size}, frame)) return 0;
  if (!IsWellFormed(frame)) std::abort();
  std::array<uint8_t, kMaxUdpDatagram> datagram;
  Frame again;
  if (!DecodeUdp(std::span(datagram).first(EncodeUdp(frame, 0, datagram)), again)) std::abort();
  if (!SameOnWire(frame, again)) std::abort();
  return 0;
}
