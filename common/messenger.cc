#include "common/messenger.h"

#include <fmt/format.h>

#include <stdexcept>

#include "common/lcm_guard.h"

namespace plumb {
namespace {

constexpr int kMostAttempts = 3;

}  // namespace

Messenger::Messenger(const std::string& url) : url_(url), lcm_(url) {
  // liblcm tests itself when its file descriptor is first wanted, in two tenths of a second: a busy machine may need another go.
  // A subscription made where that fails is a null pointer.
  bool works = lcm_.good();
  for (int attempt = 0; works && lcm_.getFileno() < 0; ++attempt) works = attempt < kMostAttempts;
  if (!works) {
    const bool multicast = url.empty() || url.rfind("udpm", 0) == 0;
    throw std::runtime_error(fmt::format(
        "cannot open LCM at '{}'{}", url,
        multicast ? ": no route for multicast? Cure: ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo"
                  : ""));
  }
  Guard();
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
