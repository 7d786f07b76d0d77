#pragma once

#include <sys/types.h>

#include <cstdint>
#include <map>
#include <vector>

#include "common/receive_queues.h"

namespace plumb {

/// A process that listens to a port.
struct Listener {
  ReceiveQueue queue;
  /// Whether it is dealing with what it has taken: a program that uses liblcm keeps 30 messages of
  /// a subscription and drops those that come on top, where nobody sees it. Never so of our
  /// own, which keep more, nor of processes that we may not look at.
  bool working = false;
};

/// Who listens to a UDP port on this machine, as /proc tells. Not thread-safe.
class Listeners {
 public:
  explicit Listeners(uint16_t port) : port_(port) {}
  std::vector<Listener> Look();

 private:
  const uint16_t port_;
  std::map<uint64_t, pid_t> processes_;  // by socket; 0: not to be looked at
};

/// The process that has a socket; 0 if we cannot see it. @param socket its inode. Thread-safe.
pid_t FindOwner(uint64_t socket);
/// Whether all threads of a process wait for something to happen, or are stopped; true if there is
/// no such process. Thread-safe.
bool Rests(pid_t process);

}  // namespace plumb
