#include "common/lockstep/lcm_mirror.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <stdexcept>
#include <string_view>

namespace plumb {
namespace {

constexpr int kNap = 2;           // [ms] of real time for which there was nothing to do
constexpr int kMaxRead = 10'000;  // messages in one go
constexpr size_t kMaxMessages = 400, kMaxBytes = 500'000;  // on their way
constexpr size_t kMaxBehind = 20'000;                      // messages
constexpr size_t kMaxGivenUp = 4000;                       // remembered
constexpr int kImpatient = 50;

size_t Hash(std::span<const uint8_t> message) {
  return std::hash<std::string_view>{}(
      {reinterpret_cast<const char*>(message.data()), message.size()});
}

}  // namespace

LcmMirror::LcmMirror(const std::string& url, int patience)
    : patience_(patience),
      messenger_(url),
      subscription_(messenger_.Subscribe(
          ".*", [this](const auto& channel, const auto& message) { OnMessage(channel, message); })),
      thread_([this] { Work(); }) {}

LcmMirror::~LcmMirror() {
  ended_ = true;
  thread_.join();
}

void LcmMirror::Publish(const std::string& channel, std::span<const uint8_t> message) {
  if (unfinished_ >= kMaxBehind) AwaitRoom(kMaxBehind / 2);
  const std::lock_guard lock(mutex_);
  if (failure_) std::rethrow_exception(failure_);
  TellOfLosses();
  ++unfinished_;
  queue_.push_back({channel, {message.begin(), message.end()}});
}

void LcmMirror::Flush() {
  AwaitRoom(0);
  TellOfLosses();
}

/// At the first, the second, the fourth, ... time.
void LcmMirror::TellOfLosses() {
  const int64_t lost = lost_;
  if (lost < std::max<int64_t>(1, 2 * told_)) return;
  told_ = lost;
  spdlog::warn("{} messages did not come back from LCM: who listens there has lost them, too",
               lost);
}

std::vector<LcmMirror::Message> LcmMirror::TakeStrangers() {
  const std::lock_guard lock(mutex_);
  stranger_bytes_ = 0;
  return std::exchange(strangers_, {});
}

void LcmMirror::AwaitRoom(size_t messages) {
  while (unfinished_ > messages) {
    {
      const std::lock_guard lock(mutex_);
      if (failure_) std::rethrow_exception(failure_);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(kNap));
  }
}

void LcmMirror::Work() {
  std::vector<Message> batch;
  try {
    while (!ended_) {
      {
        const std::lock_guard lock(mutex_);
        std::swap(batch, queue_);
      }
      for (const Message& message : batch) Say(message);
      // Looks now and then instead of being told, which would cost the run more than it costs us.
      if (batch.empty()) Nap();
      messenger_.Drain(kMaxRead);
      batch.clear();
    }
    // The last words of a run that was stopped, its driver's among them.
    const std::lock_guard lock(mutex_);
    for (const Message& message : queue_) messenger_.Publish(message.channel, message.bytes);
  } catch (...) {
    const std::lock_guard lock(mutex_);
    failure_ = std::current_exception();
  }
}

/// Naps are counted, and not the time: where this process stands still, so does what it waits for.
/// So that they are naps under a flood as well, nobody wakes it.
void LcmMirror::Nap() {
  std::this_thread::sleep_for(std::chrono::milliseconds(kNap));
  if (said_.empty()) return;
  const int naps = patience_ * (100 / kNap);
  if (said_.front().naps++ >= (patient_ ? naps : naps / kImpatient)) GiveUp();
}

/// What was said since the lost one has had no better chance.
void LcmMirror::GiveUp() {
  lost_ += static_cast<int64_t>(said_.size());
  unfinished_ -= said_.size();
  said_bytes_ = 0;
  patient_ = false;
  given_up_.insert(given_up_.end(), said_.begin(), said_.end());
  said_.clear();
  while (given_up_.size() > kMaxGivenUp) given_up_.pop_front();
}

void LcmMirror::Say(const Message& message) {
  if (said_.size() >= kMaxMessages || said_bytes_ + message.bytes.size() > kMaxBytes) {
    while (!ended_ && (said_.size() > kMaxMessages / 2 || said_bytes_ > kMaxBytes / 2)) {
      Nap();
      messenger_.Drain(kMaxRead);
    }
  }
  said_.push_back(
      {message.channel, ++numbers_[message.channel], message.bytes.size(), Hash(message.bytes), 0});
  said_bytes_ += message.bytes.size();
  if (!messenger_.Publish(message.channel, message.bytes)) {
    throw std::runtime_error(fmt::format("LCM: {}, number {} on its channel, could not be sent",
                                         message.channel, said_.back().number));
  }
}

void LcmMirror::OnMessage(const std::string& channel, std::span<const uint8_t> message) noexcept {
  const size_t hash = Hash(message);
  const auto find = [&](std::deque<Said>& among) {
    return std::ranges::find_if(among, [&](const Said& said) {
      return said.hash == hash && said.bytes == message.size() && said.channel == channel;
    });
  };
  if (const auto ours = find(said_); ours != said_.end()) {
    said_bytes_ -= ours->bytes;
    said_.erase(ours);
    --unfinished_;
    patient_ = true;
  } else if (const auto late = find(given_up_); late != given_up_.end()) {
    given_up_.erase(late);
  } else if (channel != kSelfTest) {
    const std::lock_guard lock(mutex_);
    const size_t cost = message.size() + kStrangerOverhead;
    if (stranger_bytes_ + cost > kMaxStrangers) return;
    stranger_bytes_ += cost;
    strangers_.push_back({channel, {message.begin(), message.end()}});
  }
}

}  // namespace plumb
