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

// What the coordinator brings goes to the subscribers by liblcm's queue within the process.
Messenger::Messenger(Participant& participant) : url_("memq://"), participant_(&participant), lcm_(url_) {}

bool Messenger::Publish(const std::string& channel, std::span<const uint8_t> message) {
  if (!participant_) {
    return lcm_.publish(channel, message.data(), static_cast<unsigned>(message.size())) == 0;
  }
  participant_->Say(ChannelTopic(channel), {message.begin(), message.end()});
  return true;
}

void Messenger::OnSubscription(const std::string& channel) {
  if (participant_) {
    participant_->Listen(ChannelTopic(channel));
  } else {
    Guard();
  }
}

int Messenger::Drain(int most) {
  if (participant_) {
    std::deque<lockstep_post_t>& heard = participant_->messages();
    int handled = 0;
    for (; handled < most && !heard.empty(); heard.pop_front(), ++handled) {
      lcm_.publish(heard.front().topic.name, heard.front().data.data(), static_cast<unsigned>(heard.front().size));
      lcm_.handleTimeout(0);
    }
    return handled;
  }
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
