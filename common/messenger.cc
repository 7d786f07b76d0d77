#include "common/messenger.h"

#include <fmt/format.h>

#include <stdexcept>

#include "common/lcm_guard.h"

namespace plumb {
namespace {

constexpr int kMaxAttempts = 3;

}  // namespace

Messenger::Messenger(const std::string& url) : url_(url), lcm_(url) {
  // liblcm tests itself when its file descriptor is first wanted, in two tenths of a second: a busy
  // machine may need another go. A subscription made where that fails is a null pointer.
  bool works = lcm_.good();
  for (int attempt = 0; works && lcm_.getFileno() < 0; ++attempt) works = attempt < kMaxAttempts;
  if (!works) {
    const bool multicast = url.empty() || url.rfind("udpm", 0) == 0;
    throw std::runtime_error(fmt::format("cannot open LCM at '{}'{}", url,
                                         multicast
                                             ? ": no route for multicast? Cure: ip link set lo up "
                                               "multicast on && ip route add 224.0.0.0/4 dev lo"
                                             : ""));
  }
  Guard();
}

// liblcm has nothing to do in virtual time: what the coordinator brings goes straight to the
// subscribers.
Messenger::Messenger(Participant& participant)
    : url_("memq://"), participant_(&participant), lcm_(url_) {}

bool Messenger::Publish(const std::string& channel, std::span<const uint8_t> message) {
  if (!participant_) {
    return lcm_.publish(channel, message.data(), static_cast<unsigned>(message.size())) == 0;
  }
  participant_->Say(ChannelTopic(channel), {message.begin(), message.end()});
  return true;
}

std::unique_ptr<Messenger::Subscription> Messenger::Subscribe(const std::string& channel,
                                                              Handler handler) {
  return std::make_unique<Subscription>(*this, channel, std::move(handler));
}

Messenger::Subscription::Subscription(Messenger& messenger, const std::string& channel,
                                      Handler handler)
    : messenger_(messenger), channel_(channel), handler_(std::move(handler)) {
  if (messenger.participant_) {
    messenger.participant_->Listen(ChannelTopic(channel));
    messenger.subscriptions_.push_back(this);
  } else {
    subscription_ = messenger.lcm_.subscribe(channel, &Subscription::OnBuffer, this);
    subscription_->setQueueCapacity(0);
    messenger.Guard();
  }
}

Messenger::Subscription::~Subscription() {
  if (subscription_) messenger_.lcm_.unsubscribe(subscription_);
  std::erase(messenger_.subscriptions_, this);
}

void Messenger::Subscription::OnBuffer(const lcm::ReceiveBuffer* buffer,
                                       const std::string& channel) {
  handler_(channel, {static_cast<const uint8_t*>(buffer->data), buffer->data_size});
}

int Messenger::Drain(int max_messages) {
  int handled = 0;
  if (participant_) {
    std::deque<lockstep_post_t>& heard = participant_->messages();
    for (; handled < max_messages && !heard.empty(); ++handled) {
      const lockstep_post_t post = std::move(heard.front());
      heard.pop_front();
      for (const Subscription* subscription : subscriptions_) {
        if (subscription->channel_ == post.topic.name)
          subscription->handler_(post.topic.name, post.data);
      }
    }
    return handled;
  }
  for (; handled < max_messages; ++handled) {
    const int result = lcm_.handleTimeout(0);
    if (result < 0) return handled > 0 ? handled : -1;
    if (result == 0) return handled;
  }
  return max_messages;
}

void Messenger::Guard() {
  if (guarded_ || url_.rfind("udpm", 0) != 0) return;
  // udpm://GROUP:PORT?...
  const auto colon = url_.find(':', sizeof("udpm://") - 1);
  const int port = colon == std::string::npos ? 7667 : std::atoi(url_.c_str() + colon + 1);
  if (AttachLcmGuard(static_cast<uint16_t>(port)) <= 0) {
    throw std::runtime_error(
        fmt::format("cannot guard LCM's socket on port {} against malformed packets", port));
  }
  guarded_ = true;
}

}  // namespace plumb
