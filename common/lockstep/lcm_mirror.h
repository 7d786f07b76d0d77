#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <span>
#include <string>

#include "common/messenger.h"

namespace plumb {

/// Says on LCM what is said in a run in virtual time, so that lcm-spy, lcm-logger and others see it as ever; and hears
/// what comes back. It waits for it, so that nobody with a buffer as large as ours (2 MB) loses anything, and what does
/// not come back has been lost. Not thread-safe.
class LcmMirror {
 public:
  /// @param patience [0.1 s] of real time until a message that has not come back is lost.
  /// @throws std::runtime_error as Messenger.
  explicit LcmMirror(const std::string& url, int patience = 100);
  ~LcmMirror();

  /// @throws std::runtime_error naming channel and number, if a message of the run has not come back.
  void Publish(const std::string& channel, std::span<const uint8_t> message);
  /// Reads what there is: what others say, too.
  void Read() { messenger_.Drain(kMostRead); }
  /// Waits until everything has come back. @throws std::runtime_error as Publish.
  void Flush() { AwaitRoom(0, 0); }

  /// Called with what somebody outside the run has said.
  std::function<void(const std::string& channel, std::span<const uint8_t> message)> on_stranger =
      [](const auto&, const auto&) {};

 private:
  static constexpr int kMostRead = 10'000;
  static constexpr size_t kMostMessages = 400, kMostBytes = 500'000;  // on their way

  struct Said {
    std::string channel;
    int64_t number;  // on the channel
    size_t bytes, hash;
  };
  void OnMessage(const lcm::ReceiveBuffer* buffer, const std::string& channel) noexcept;
  void AwaitRoom(size_t messages, size_t bytes);

  const int patience_;
  Messenger messenger_;
  lcm::Subscription* subscription_;
  std::deque<Said> said_;  // that has not come back yet
  size_t bytes_ = 0;       // of it
  std::map<std::string, int64_t> numbers_;
};

}  // namespace plumb
