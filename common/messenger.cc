#include "common/messenger.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <stdexcept>

#include "common/lcm_guard.h"
#include "plumb/driver_status_t.hpp"

namespace plumb {
namespace {

constexpr int kMaxAttempts = 3;
constexpr char kDriverChannel[] = "DRIVER_STATUS";

/// The first, the 10th, the 100th ...: whoever floods us is not to fill the disk.
void WarnNowAndThen(std::string_view channel, std::string_view why, int64_t count) noexcept {
  int64_t power = 1;
  while (power < count) power *= 10;
  if (power == count) spdlog::warn("{} refused: {} ({} so far)", channel, why, count);
}

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
    // Who listens twice would hear all of it twice.
    const bool listens = std::ranges::any_of(
        messenger.subscriptions_, [&](const auto* other) { return other->channel_ == channel; });
    if (!listens) messenger.participant_->Listen(ChannelTopic(channel));
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

void Messenger::Become(Identity identity) {
  identity_ = std::move(identity);
  if (!identity_.has_key()) return;
  driver_ = Subscribe(kDriverChannel, [this](const std::string&, std::span<const uint8_t> bytes) {
    OnDriverStatus(bytes);
  });
}

/// Before any Subscriber hears it, which then knows the run.
void Messenger::OnDriverStatus(std::span<const uint8_t> bytes) noexcept {
  const std::optional<Seal> seal = FindSeal(bytes);
  if (seal && seal->run == identity_.run()) return;
  try {
    driver_status_t status;
    const std::span<const uint8_t> message = Unsealed(bytes);
    const int length = static_cast<int>(message.size());
    if (status.decode(message.data(), 0, length) != length) return;
    if (!identity_.Follows(status.robot)) return OnForeignDriver("of another robot");
    const ChannelJudge::Verdict verdict =
        driver_judge_.HearDriver(identity_, status.robot, status.bus, bytes);
    if (verdict.two_speakers) return Refuse(kDriverChannel, driver_judge_, verdict, 0);
    if (!verdict.refusal.empty()) return OnForeignDriver(verdict.refusal);
    identity_.Join(seal->run, status.robot, status.bus);
  } catch (...) {  // it did not decode: the Subscribers count it
  }
}

/// Said here, as nothing else is while there is no run.
void Messenger::OnForeignDriver(std::string_view why) noexcept {
  ++foreign_drivers_;
  if (identity_.run() == 0) WarnNowAndThen(kDriverChannel, why, foreign_drivers_);
}

void Messenger::Refuse(const std::string& channel, const ChannelJudge& judge,
                       const ChannelJudge::Verdict& verdict, int64_t count) noexcept {
  // A driver may come up later than those who listen.
  const bool early = identity_.has_key() && identity_.run() == 0;
  if (!verdict.two_speakers && count > 0 && !early) WarnNowAndThen(channel, verdict.refusal, count);
  if (!verdict.two_speakers || !two_speakers_.empty()) return;
  try {
    const std::string latest = judge.latest();
    std::string owner = judge.owner();
    if (owner == latest) owner = "whoever is of this run";
    two_speakers_ = fmt::format(
        "two speak on {}: {} and {}; whom to believe cannot be told: cure: stop one of them, or "
        "--key FILE for all",
        channel, owner, latest);
  } catch (...) {  // no memory for the names
    two_speakers_ = "two speak";
  }
}

int Messenger::Drain(int max_messages) {
  const int handled = Handle(max_messages);
  if (!two_speakers_.empty()) throw std::runtime_error(std::exchange(two_speakers_, {}));
  return handled;
}

int Messenger::Handle(int max_messages) {
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
