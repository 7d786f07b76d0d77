#include "cli/preflight.h"

#include <poll.h>

#include <array>
#include <memory>
#include <stdexcept>

#include "common/clock.h"
#include "common/messenger.h"
#include "drivers/can/transport.h"
#include "plumb/driver_status_t.hpp"
#include "plumb/policy_t.hpp"

namespace plumb {
namespace {

// [us]; statuses come ten times a second, heartbeats at least as often
constexpr int64_t kListenFirst = 500'000;

bool IsVirtual(const std::string& url) {
  return url.starts_with("udp:") || url.starts_with("socketcan:vcan") || url.starts_with("loop:");
}

}  // namespace

void RequireFree(const std::string& lcm_url, const std::vector<BusDescription>& buses, bool real) {
  std::vector<std::unique_ptr<Transport>> ends;
  for (const BusDescription& bus : buses) {
    if (!real && !IsVirtual(InnermostBus(bus.url))) {
      throw std::invalid_argument(
          bus.url + " is neither udp: nor a vcan interface: if a robot is on it, say --real");
    }
    ends.push_back(OpenTransport(bus.url));
  }
  Messenger messenger(lcm_url);
  const Subscriber<driver_status_t> drivers(messenger, "DRIVER_STATUS");
  const Subscriber<policy_t> policies(messenger, "POLICY");
  std::vector<pollfd> polled{{messenger.fd(), POLLIN, 0}};
  for (const auto& end : ends) polled.push_back({end->fd(), POLLIN, 0});
  std::array<Frame, 64> frames;
  const Clock clock;
  for (const int64_t deadline = clock.Now() + kListenFirst; clock.Now() < deadline;) {
    poll(polled.data(), polled.size(), 10);
    messenger.Drain();
    if (drivers.received() > 0 || policies.received() > 0) {
      throw std::runtime_error("another run is under way on " + lcm_url +
                               ": stop it, or give --lcm-url");
    }
    for (size_t i = 0; i < ends.size(); ++i) {
      ends[i]->SetTime(clock.Now());
      if (ends[i]->Receive(frames) > 0 && !real) {
        throw std::runtime_error("somebody talks on " + buses[i].url +
                                 " already: give another --bus (or --real)");
      }
    }
  }
}

}  // namespace plumb
