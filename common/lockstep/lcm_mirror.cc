#include "common/lockstep/lcm_mirror.h"

#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <stdexcept>
#include <string_view>

namespace plumb {
namespace {

constexpr int kGlance = 100;  // [ms] of real time between two looks for a message on its way
constexpr char kSelfTest[] = "LCM_SELF_TEST";  // which liblcm says to itself when it starts

size_t Hash(std::span<const uint8_t> message) {
  return std::hash<std::string_view>{}({reinterpret_cast<const char*>(message.data()), message.size()});
}

}  // namespace

LcmMirror::LcmMirror(const std::string& url, int patience) : patience_(patience), messenger_(url) {
  subscription_ = messenger_.lcm().subscribe(".*", &LcmMirror::OnMessage, this);
  subscription_->setQueueCapacity(0);
  messenger_.OnSubscription(".*");
}

LcmMirror::~LcmMirror() { messenger_.lcm().unsubscribe(subscription_); }

void LcmMirror::Publish(const std::string& channel, std::span<const uint8_t> message) {
  if (said_.size() >= kMostMessages || bytes_ + message.size() > kMostBytes) AwaitRoom(kMostMessages / 2, kMostBytes / 2);
  said_.push_back({channel, ++numbers_[channel], message.size(), Hash(message)});
  bytes_ += message.size();
  if (!messenger_.Publish(channel, message)) {
    throw std::runtime_error(fmt::format("LCM: {}, number {}, could not be sent", channel, said_.back().number));
  }
}

void LcmMirror::AwaitRoom(size_t messages, size_t bytes) {
  Read();
  for (int glance = 0; said_.size() > messages || bytes_ > bytes; ++glance) {
    if (glance == patience_) {
      throw std::runtime_error(fmt::format("lost on LCM: {}, number {} on its channel, has not come back",
                                           said_.front().channel, said_.front().number));
    }
    const size_t before = said_.size();
    pollfd readable{messenger_.fd(), POLLIN, 0};
    poll(&readable, 1, kGlance);
    Read();
    if (said_.size() < before) glance = -1;
  }
}

void LcmMirror::OnMessage(const lcm::ReceiveBuffer* buffer, const std::string& channel) noexcept {
  const std::span message(static_cast<const uint8_t*>(buffer->data), buffer->data_size);
  const size_t hash = Hash(message);
  const auto ours = std::ranges::find_if(said_, [&](const Said& said) {
    return said.hash == hash && said.bytes == message.size() && said.channel == channel;
  });
  if (ours != said_.end()) {
    bytes_ -= ours->bytes;
    said_.erase(ours);
  } else if (channel != kSelfTest) {
    on_stranger(channel, message);
  }
}

}  // namespace plumb
