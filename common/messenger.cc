#include "common/messenger.h"

#include <fmt/format.h>
#include <poll.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <stdexcept>

#include "common/clock.h"
#include "common/message_bytes.h"
#include "plumb/driver_status_t.hpp"

namespace plumb {
namespace {

constexpr int64_t kPatience = 10'000'000;  // [us], as liblcm has it
constexpr int kAgain = 100;                // [ms]

bool IsMulticast(const std::string& url) { return url.starts_with("udpm:"); }

/// What liblcm is opened with. It reads multicast URLs less strictly than we do: it gets one that
/// cannot be misunderstood.
std::string SendingUrl(const std::string& url) {
  if (url.starts_with("mpudpm:"))
    throw std::runtime_error(
        url + ": mpudpm: is not supported, its sockets cannot be guarded; cure: udpm:");
  if (!IsMulticast(url)) return url;
  const MulticastAddress address = ParseUdpm(url);
  return fmt::format("udpm://{}:{}?ttl={}", address.group, address.port, address.ttl);
}

std::runtime_error CannotOpen(const std::string& url, const std::string& reason = {}) {
  return std::runtime_error(fmt::format(
      "cannot open LCM at '{}'{}{}", url, reason.empty() ? "" : " (" + reason + ")",
      IsMulticast(url) ? ": no route for multicast?; cure: ip link set lo up multicast on && "
                         "ip route add 224.0.0.0/4 dev lo"
                       : ""));
}

/// The first, the 10th, the 100th ...: whoever floods us is not to fill the disk.
void WarnNowAndThen(std::string_view channel, std::string_view why, int64_t count) noexcept {
  int64_t power = 1;
  while (power < count) power *= 10;
  if (power == count) spdlog::warn("{} refused: {} ({} so far)", channel, why, count);
}

}  // namespace

Messenger::Messenger(const std::string& url) : lcm_(SendingUrl(ResolvedLcmUrl(url))) {
  const std::string resolved = ResolvedLcmUrl(url);
  if (!lcm_.good()) throw CannotOpen(resolved);
  if (IsMulticast(resolved)) {
    try {
      receiver_.emplace(ParseUdpm(resolved));
    } catch (const std::system_error& error) {
      throw CannotOpen(resolved, error.what());
    }
    TestItself(resolved);
  } else if (lcm_.getFileno() < 0) {
    // A subscription made now would be a null pointer.
    throw CannotOpen(resolved);
  }
}

// liblcm has nothing to do in virtual time: what the coordinator brings goes straight to the
// subscribers.
Messenger::Messenger(Participant& participant) : participant_(&participant), lcm_("memq://") {}

/// Where a firewall or a route keeps our messages from coming back, nobody else gets them either.
void Messenger::TestItself(const std::string& url) {
  const Clock clock;
  const std::string word = fmt::format("{} {}", getpid(), clock.Now());
  const std::span<const uint8_t> bytes(reinterpret_cast<const uint8_t*>(word.data()), word.size());
  bool heard = false;
  const auto test = Subscribe(kSelfTest, [&](const std::string&, std::span<const uint8_t> message) {
    heard = heard || std::ranges::equal(message, bytes);
  });
  for (const int64_t end = clock.Now() + kPatience; !heard && clock.Now() < end; Drain()) {
    Publish(kSelfTest, bytes);
    Await(kAgain);
  }
  if (!heard) throw CannotOpen(url, "what is sent does not come back");
}

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
  } else if (messenger.receiver_) {
    queue_ = messenger.receiver_->Listen(channel, handler_);
  } else {
    subscription_ = messenger.lcm_.subscribe(channel, &Subscription::OnBuffer, this);
    subscription_->setQueueCapacity(0);
  }
}

Messenger::Subscription::~Subscription() {
  if (subscription_) messenger_.lcm_.unsubscribe(subscription_);
  if (queue_) messenger_.receiver_->Forget(queue_);
  std::erase(messenger_.subscriptions_, this);
}

void Messenger::Subscription::OnBuffer(const lcm::ReceiveBuffer* buffer,
                                       const std::string& channel) {
  handler_(channel, {static_cast<const uint8_t*>(buffer->data), buffer->data_size});
}

void Messenger::Await(int timeout) {
  pollfd polled{fd(), POLLIN, 0};
  poll(&polled, 1, timeout);
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
    if (!Decode(Unsealed(bytes), status)) return;
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

void Messenger::DrainForGood() {
  if (receiver_) receiver_->Leave();
  while (Drain() > 0) {
  }
}

int Messenger::Handle(int max_messages) {
  if (receiver_) return receiver_->Drain(max_messages);
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

}  // namespace plumb
