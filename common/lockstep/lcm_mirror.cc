#include "common/lockstep/lcm_mirror.h"

#include <fmt/format.h>
#include <poll.h>

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
  ++unfinished_;
  queue_.push_back({channel, {message.begin(), message.end()}});
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
void LcmMirror::Nap() {
  pollfd readable{messenger_.fd(), POLLIN, 0};
  poll(&readable, 1, kNap);
  if (said_.empty() || said_.front().naps++ < patience_ * (100 / kNap)) return;
  throw std::runtime_error(
      fmt::format("lost on LCM: {}, number {} on its channel, has not come back",
                  said_.front().channel, said_.front().number));
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
  const auto ours = std::ranges::find_if(said_, [&](const Said& said) {
    return said.hash == hash && said.bytes == message.size() && said.channel == channel;
  });
  if (ours != said_.end()) {
    said_bytes_ -= ours->bytes;
    said_.erase(ours);
    --unfinished_;
  } else if (channel != kSelfTest) {
    const std::lock_guard lock(mutex_);
    const size_t cost = message.size() + kStrangerOverhead;
    if (stranger_bytes_ + cost > kMaxStrangers) return;
    stranger_bytes_ += cost;
    strangers_.push_back({channel, {message.begin(), message.end()}});
  }
}

}  // namespace plumb
