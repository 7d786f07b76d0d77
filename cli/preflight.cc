#include "cli/preflight.h"

#include <poll.h>

#include <array>
#include <stdexcept>

#include "common/clock.h"
#include "common/messenger.h"
#include "drivers/can/transport.h"
#include "plumb/driver_status_t.hpp"
#include "plumb/policy_t.hpp"

namespace plumb {
namespace {

// [us]; statuses come ten times a second, heartbeats at least as often
constexpr int64_t kListen = 500'000;

bool StartsWith(const std::string& text, const std::string& start) {
  return text.rfind(start, 0) == 0;
}

}  // namespace

std::string InnermostBus(std::string url) {
  constexpr size_t kScheme = 7;
  while (StartsWith(url, "faulty:")) {
    const size_t colon = url.find(':', kScheme);
    url.erase(0, colon == std::string::npos ? kScheme : colon + 1);
  }
  return url;
}

void RequireFree(const std::string& lcm_url, const std::string& bus_url, bool real) {
  const std::string innermost = InnermostBus(bus_url);
  if (!real && !StartsWith(innermost, "udp:") && !StartsWith(innermost, "socketcan:vcan") &&
      !StartsWith(innermost, "loop:")) {
    throw std::invalid_argument(
        bus_url + " is neither udp: nor a vcan interface: if a robot is on it, say --real");
  }
  const auto bus = OpenTransport(bus_url);
  Messenger messenger(lcm_url);
  const Subscriber<driver_status_t> drivers(messenger, "DRIVER_STATUS");
  const Subscriber<policy_t> policies(messenger, "POLICY");
  std::array<Frame, 64> frames;
  const Clock clock;
  for (const int64_t deadline = clock.Now() + kListen; clock.Now() < deadline;) {
    std::array<pollfd, 2> polled{{{messenger.fd(), POLLIN, 0}, {bus->fd(), POLLIN, 0}}};
    poll(polled.data(), polled.size(), 10);
    messenger.Drain();
    if (drivers.received() > 0 || policies.received() > 0) {
      throw std::runtime_error("another run is under way on " + lcm_url +
                               ": stop it, or give --lcm-url");
    }
    bus->SetTime(clock.Now());
    if (bus->Receive(frames) > 0 && !real) {
      throw std::runtime_error("somebody talks on " + bus_url +
                               " already: give another --bus (or --real)");
    }
  }
}

}  // namespace plumb
