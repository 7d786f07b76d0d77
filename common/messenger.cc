#include "common/messenger.h"

#include <fmt/format.h>

#include <stdexcept>

#include "common/lcm_guard.h"

namespace plumb {

Messenger::Messenger(const std::string& url) : url_(url), lcm_(url) {
  if (!lcm_.good()) {
    const bool multicast = url.empty() || url.rfind("udpm", 0) == 0;
    throw std::runtime_error(fmt::format(
        "cannot open LCM at '{}'{}", url,
        multicast ? ": no route for multicast? Cure: ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo"
                  : ""));
  }
}

int Messenger::Drain(int most) {
  for (int handled = 0; handled < most; ++handled) {
    const int result = lcm_.handleTimeout(0);
    if (result < 0) return handled > 0 ? handled : -1;
    if (result == 0) return handled;
  }
  return most;
}

void Messenger::Guard() {
  if (guarded_ || url_.rfind("udpm", 0) != 0) return;
  // udpm://GROUP:PORT?...
  const auto colon = url_.find(':', sizeof("udpm://") - 1);
  const int port = colon == std::string::npos ? 7667 : std::atoi(url_.c_str() + colon + 1);
  if (AttachLcmGuard(static_cast<uint16_t>(port)) <= 0) {
    throw std::runtime_error(fmt::format("cannot guard LCM's socket on port {} against malformed packets", port));
  }
  guarded_ = true;
}

}  // namespace plumb
