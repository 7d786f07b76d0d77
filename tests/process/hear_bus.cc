// Prints the frames that a bus hands out, one a line, up to the frame 7FF#: hear_bus URL. Says
// "listening" first.

#include <poll.h>

#include <array>
#include <iostream>

#include "drivers/can/transport.h"

int main(int, char** argv) {
  const auto bus = plumb::OpenTransport(argv[1]);
  std::cout << "listening" << std::endl;
  std::array<plumb::Frame, 8> frames;
  for (;;) {
    pollfd readable{bus->fd(), POLLIN, 0};
    poll(&readable, 1, -1);
    const int count = bus->Receive(frames);
    for (int i = 0; i < count; ++i) {
      const plumb::Frame& frame = frames[static_cast<size_t>(i)];
      if (frame.id == 0x7FF) return 0;
      std::cout << ToText(frame) << std::endl;
    }
  }
}
