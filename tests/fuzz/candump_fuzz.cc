// libFuzzer: any file is refused as a log, or replayed from the first frame to the last: each of
// them well-formed and the same after a way through text, all of them counted, none of them late.

#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <stdexcept>
#include <string>

#include "drivers/can/transport.h"

namespace plumb {
namespace {

void Require(bool right) {
  if (!right) std::abort();
}

void Replay(const std::string& url) {
  std::unique_ptr<Transport> replay;
  try {
    replay = OpenTransport(url);
  } catch (const std::runtime_error& error) {
    Require(std::string(error.what()).find("no line of it is a frame") != std::string::npos);
    return;
  }
  std::array<Frame, 3> frames;
  int64_t total = 0;
  replay->SetTime(1000);
  for (int64_t next; (next = replay->NextEvent()) != Transport::kNever;) {
    Require(next >= 1000);
    replay->SetTime(next);
    const int count = replay->Receive(frames);
    Require(count > 0);
    total += count;
    for (const Frame& frame : std::span(frames).first(static_cast<size_t>(count))) {
      Require(IsWellFormed(frame) && frame.receive_ns >= 0);
      const auto again = FrameFromText(ToText(frame));
      Require(again && SameOnWire(frame, *again));
    }
  }
  Require(total > 0 && total == replay->stats().received);
  Require(replay->Receive(frames) == 0);
}

}  // namespace
}  // namespace plumb

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const int file = memfd_create("log", MFD_CLOEXEC);
  plumb::Require(ftruncate(file, 0) == 0);
  plumb::Require(pwrite(file, data, size, 0) == static_cast<ssize_t>(size));
  plumb::Replay("replay:/proc/self/fd/" + std::to_string(file));
  return 0;
}
