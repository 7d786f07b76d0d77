#pragma once

#include <netinet/in.h>

#include <cstdint>
#include <deque>
#include <functional>
#include <list>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "common/file_descriptor.h"
#include "common/lcm_datagrams.h"
#include "common/lcm_url.h"

namespace plumb {

/// Receives what is sent to LCM's multicast group, in liblcm's place: that binds its socket before
/// anybody can guard it, writes out of bounds where a crafted datagram says so (lcm-proj/lcm pull
/// request 628), and keeps without bound what nobody takes, or the oldest.
///
/// Nothing else comes in: the kernel drops what is addressed to another group or to this machine
/// alone and, with a TTL of 0, what arrives from outside (see lcm_receiver.cc). A thread of its own
/// reads the socket, so that a process may compute for minutes; for each listener it keeps the
/// newest kMaxQueued bytes. Its methods are to be called by one thread.
class LcmReceiver {
 public:
  /// Of messages that wait for one listener, with what they cost [bytes].
  static constexpr size_t kMaxQueued = size_t{32} << 20;

  using Handler = std::function<void(const std::string& channel, std::span<const uint8_t> message)>;
  /// A listener's messages.
  class Queue;
  /// Messages that have been dropped because newer ones came before they were taken.
  struct Loss {
    std::string channel;
    int64_t messages;
  };

  /// @throws std::system_error if the group cannot be listened to.
  explicit LcmReceiver(const MulticastAddress& address);
  ~LcmReceiver();
  LcmReceiver(const LcmReceiver&) = delete;
  LcmReceiver& operator=(const LcmReceiver&) = delete;

  /// Readable while messages wait.
  int fd() const { return waiting_fd_.get(); }
  /// @param channel exactly this one, or ".*" for all. @param handler called by Drain; must not
  /// throw, nor call Listen or Forget.
  Queue* Listen(const std::string& channel, Handler handler);
  void Forget(Queue* queue);
  /// Handles the messages that are there when it is called, at most `max_messages`, in the order in
  /// which they arrived, whoever they are for. @return how many.
  int Drain(int max_messages);
  /// Leaves the group: what is sent from now on is not heard, and all that was sent before waits to
  /// be drained.
  void Leave();
  /// When the message that is being handled arrived, monotonic [us].
  int64_t arrival() const { return arrival_; }
  /// Since the last call.
  std::vector<Loss> TakeLosses();

 private:
  void Open(const MulticastAddress& address);
  void Work();
  void StopWork();
  bool Receive(std::span<uint8_t> buffer);
  void Keep(const LcmDatagrams::Message& message);
  bool Wanted(std::string_view channel) const;
  Queue* Oldest();

  FileDescriptor socket_, waiting_fd_, stop_fd_;
  ip_mreqn membership_{};
  LcmDatagrams datagrams_;  // of the thread, while there is one
  std::mutex mutex_;        // of what follows
  std::list<Queue> queues_;
  uint64_t arrived_ = 0;  // messages so far
  size_t waiting_ = 0;    // messages in all queues
  int64_t arrival_ = 0;   // of the message that is being handled
  std::thread thread_;
};

}  // namespace plumb
