#pragma once

#include <cstdint>
#include <exception>
#include <functional>
#include <lcm/lcm-cpp.hpp>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/clock.h"
#include "common/identity.h"
#include "common/lcm_receiver.h"
#include "common/lcm_url.h"
#include "common/lockstep/participant.h"
#include "common/message_bytes.h"

namespace plumb {

/// One process's connection to LCM. Messages go out by liblcm and, where the URL is one of
/// multicast, come in by LcmReceiver. Not thread-safe.
class Messenger {
 public:
  /// @param url an LCM URL: udpm, memq, file or tcpq; empty as ResolvedLcmUrl has it.
  /// @throws std::runtime_error that says how to cure it (no multicast route is the usual cause).
  explicit Messenger(const std::string& url);
  /// The messages of a run in virtual time, which its coordinator carries.
  explicit Messenger(Participant& participant);

  /// From now on what Publishers say is sealed, and what Subscribers hear is judged, as this
  /// process's. Before there are any.
  void Become(Identity identity);
  Identity& identity() { return identity_; }
  /// With a key: this process, the driver, hands out the run (see Identity).
  void Lead(const std::string& robot, const std::string& bus) { identity_.Lead(robot, bus); }
  /// With a key: takes part in the run of this robot's driver only.
  void Follow(const std::string& robot) { identity_.Follow(robot); }
  /// A Subscriber has heard what is not to be believed. Two speakers end the next Drain; the others
  /// are said once, and then less and less often. @param count of them on that channel; 0: somebody
  /// else says it.
  void Refuse(const std::string& channel, const ChannelJudge& judge,
              const ChannelJudge::Verdict& verdict, int64_t count) noexcept;

  /// For poll: readable while messages wait. Not in virtual time.
  int fd() { return receiver_ ? receiver_->fd() : lcm_.getFileno(); }
  /// Sleeps until messages wait, or for `timeout` [ms] of the machine's time. Not in virtual time.
  void Await(int timeout);
  /// Says the bytes as they are. @return false if the message was not sent (liblcm says no more).
  bool Publish(const std::string& channel, std::span<const uint8_t> message);
  /// Handles the messages that have arrived, at most `max_messages`, so that a flood does not keep
  /// the caller from its other duties; what is left keeps fd() readable. @return how many, -1 at
  /// the end of a file or on failure.
  /// @throws std::runtime_error if two speak on a channel that is one's, naming channel and both.
  int Drain(int max_messages = 1000);
  /// Handles all that was sent before, and hears nothing of what is sent from now on, where the URL
  /// is one of multicast. @throws as Drain.
  void DrainForGood();
  /// Messages that came faster than they were drained, since the last call: of each listener
  /// LcmReceiver::kMaxQueued bytes are kept.
  std::vector<LcmReceiver::Loss> TakeLosses() {
    return receiver_ ? receiver_->TakeLosses() : std::vector<LcmReceiver::Loss>();
  }
  /// Called with a message's bytes as they arrived; must not throw.
  using Handler = LcmReceiver::Handler;
  /// When the message that is being handled arrived, by the machine's monotonic clock [us].
  int64_t Arrival() const { return receiver_ ? receiver_->arrival() : Clock().Now(); }
  class Subscription;
  /// Listens to a channel (in real time: ".*" is all of them) as long as the subscription lives. In
  /// order of arrival.
  std::unique_ptr<Subscription> Subscribe(const std::string& channel, Handler handler);

 private:
  void TestItself(const std::string& url);
  int Handle(int max_messages);
  void OnDriverStatus(std::span<const uint8_t> message) noexcept;
  void OnForeignDriver(std::string_view why) noexcept;

  Participant* participant_ = nullptr;  // of a run in virtual time
  lcm::LCM lcm_;
  std::optional<LcmReceiver> receiver_;       // of multicast
  std::vector<Subscription*> subscriptions_;  // in virtual time
  Identity identity_;
  ChannelJudge driver_judge_;
  std::unique_ptr<Subscription> driver_;  // whose run we may join, with a key
  int64_t foreign_drivers_ = 0;           // statuses of drivers whose run we do not join
  std::string two_speakers_;              // empty: there are none
};

/// Ends with its destruction. Must not outlive the Messenger.
class Messenger::Subscription {
 public:
  Subscription(Messenger& messenger, const std::string& channel, Handler handler);
  ~Subscription();
  Subscription(const Subscription&) = delete;
  Subscription& operator=(const Subscription&) = delete;

 private:
  friend class Messenger;
  void OnBuffer(const lcm::ReceiveBuffer* buffer, const std::string& channel);

  Messenger& messenger_;
  const std::string channel_;
  const Handler handler_;
  // One of them, or none in virtual time.
  LcmReceiver::Queue* queue_ = nullptr;
  lcm::Subscription* subscription_ = nullptr;
};

/// Receives messages of one type on one channel, and judges whether they are to be believed
/// (Identity). Decodes them itself, because an exception must never cross liblcm's C frames: what
/// does not decode is counted and forgotten. Not thread-safe; must not outlive the Messenger.
template <class Message>
class Subscriber {
 public:
  using Callback = std::function<void(const Message&)>;
  /// Of a message that decodes and is not to be believed. @param why a literal.
  using RefusalCallback = std::function<void(const Message&, std::string_view why)>;

  /// @param callback called for every message, in order of arrival; may be empty when newest() is
  /// enough. It may throw: the exception is kept and thrown again by Rethrow().
  /// @param on_refused must not throw.
  Subscriber(Messenger& messenger, const std::string& channel, Callback callback = {},
             Speakers speakers = Speakers::kOne, RefusalCallback on_refused = {})
      : messenger_(messenger),
        channel_(channel),
        callback_(std::move(callback)),
        on_refused_(std::move(on_refused)),
        judge_(speakers),
        subscription_(messenger.Subscribe(
            channel,
            [this](const std::string&, std::span<const uint8_t> bytes) { OnMessage(bytes); })) {}
  Subscriber(const Subscriber&) = delete;
  Subscriber& operator=(const Subscriber&) = delete;

  /// The newest message that decoded, untouched by later ones that did not; meaningless while
  /// received() is 0.
  const Message& newest() const { return newest_; }
  int64_t received() const { return received_; }
  /// Messages that did not decode: wrong type, wrong length, hostile counts.
  int64_t rejected() const { return rejected_; }
  /// Messages that decoded and are not to be believed.
  int64_t refused() const { return refused_; }
  /// Throws what the callback threw, if it did.
  void Rethrow() {
    if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
  }

 private:
  void OnMessage(std::span<const uint8_t> bytes) noexcept {
    try {
      // The two members take turns and keep their vectors' capacity: no allocation for messages of
      // equal size.
      if (!Decode(Unsealed(bytes), arriving_)) {
        arriving_ = {};  // which may be a hundred times as large as what it was refused for
        ++rejected_;
        return;
      }
      const ChannelJudge::Verdict verdict = judge_.Hear(messenger_.identity(), channel_, bytes);
      if (!verdict.refusal.empty()) {
        ++refused_;
        messenger_.Refuse(channel_, judge_, verdict, on_refused_ ? 0 : refused_);
        if (on_refused_) on_refused_(arriving_, verdict.refusal);
        return;
      }
      std::swap(newest_, arriving_);
    } catch (...) {
      ++rejected_;
      return;
    }
    ++received_;
    try {
      if (callback_) callback_(newest_);
    } catch (...) {
      failure_ = std::current_exception();
    }
  }

  Messenger& messenger_;
  const std::string channel_;
  Callback callback_;
  RefusalCallback on_refused_;
  ChannelJudge judge_;
  Message newest_{}, arriving_{};
  int64_t received_ = 0, rejected_ = 0, refused_ = 0;
  std::exception_ptr failure_;
  std::unique_ptr<Messenger::Subscription> subscription_;  // ends first
};

/// Publishes messages of one type on one channel, sealed (Identity), encoding into its own buffer:
/// no allocation once the largest message has been sent. Not thread-safe; must not outlive the
/// Messenger.
template <class Message>
class Publisher {
 public:
  Publisher(Messenger& messenger, std::string channel)
      : messenger_(&messenger), channel_(std::move(channel)) {}

  /// @return false if the message was not sent (liblcm says no more).
  bool Publish(const Message& message) {
    const int size = message.getEncodedSize();
    const bool sealed = messenger_->identity().known();
    const size_t whole = static_cast<size_t>(size) + (sealed ? kSealSize : 0);
    if (whole > buffer_.size()) buffer_.resize(whole);
    if (message.encode(buffer_.data(), 0, size) != size) return false;
    const std::span<uint8_t> bytes = std::span(buffer_).first(whole);
    if (sealed) messenger_->identity().Seal(channel_, bytes);
    return messenger_->Publish(channel_, bytes);
  }

 private:
  Messenger* messenger_;
  std::string channel_;
  std::vector<uint8_t> buffer_;
};

}  // namespace plumb
