#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <exception>
#include <map>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/messenger.h"

namespace plumb {

/// Publishes the messages of a run in virtual time on LCM, so that lcm-spy, lcm-logger and others
/// see them as in any run, and receives its own messages. A new one is sent only when earlier ones
/// have come back: a listener with a buffer as large as ours (2 MB) then loses none. One that does
/// not come back, as somebody floods the group, is given up and told of in a warning: the run
/// itself has it. A thread of the mirror's own does this, so that the run need not wait. Its
/// methods are to be called by one thread.
class LcmMirror {
 public:
  struct Message {
    std::string channel;
    std::vector<uint8_t> bytes;
  };

  /// Of strangers' messages that wait to be taken, with what they cost [bytes]: room for the
  /// longest that there are, and for ten thousand requests.
  static constexpr size_t kMaxStrangers = 2 * kMaxLcmMessage, kStrangerOverhead = 256;

  /// @param patience [0.1 s] of real time until a message that has not come back is lost; until
  /// one comes back again, those after it are given a fiftieth of that.
  /// @throws std::runtime_error as Messenger.
  explicit LcmMirror(const std::string& url, int patience = 100);
  ~LcmMirror();
  LcmMirror(const LcmMirror&) = delete;
  LcmMirror& operator=(const LcmMirror&) = delete;

  /// Soon. Waits where it is far behind. @throws std::runtime_error naming channel and number, if
  /// an earlier message could not be sent.
  void Publish(const std::string& channel, std::span<const uint8_t> message);
  /// Messages that somebody outside the run has sent since the last call: the first of them, up to
  /// kMaxStrangers.
  std::vector<Message> TakeStrangers();
  /// Waits until everything has come back, or is lost. @throws std::runtime_error as Publish.
  void Flush();
  /// How many messages have been given up.
  int64_t lost() const { return lost_; }

 private:
  struct Said {
    std::string channel;
    int64_t number;  // on the channel
    size_t bytes, hash;
    int naps;  // for which it has been the oldest
  };
  void Work();
  void Say(const Message& message);
  void OnMessage(const std::string& channel, std::span<const uint8_t> message) noexcept;
  void Nap();
  void GiveUp();
  void TellOfLosses();
  void AwaitRoom(size_t messages);

  const int patience_;
  // Of the thread.
  Messenger messenger_;
  std::unique_ptr<Messenger::Subscription> subscription_;
  std::deque<Said> said_;      // that has not come back yet
  size_t said_bytes_ = 0;      // of it
  std::deque<Said> given_up_;  // the last of them, which are ours if they come after all
  bool patient_ = true;
  std::map<std::string, int64_t> numbers_;
  // Of both.
  std::mutex mutex_;
  std::vector<Message> queue_;
  std::vector<Message> strangers_;
  size_t stranger_bytes_ = 0;  // that they cost
  std::exception_ptr failure_;
  std::atomic<size_t> unfinished_ = 0;  // that were published and have not come back
  std::atomic<int64_t> lost_ = 0;
  int64_t told_ = 0;  // of lost_; the owner's
  std::atomic<bool> ended_ = false;
  std::thread thread_;
};

}  // namespace plumb
