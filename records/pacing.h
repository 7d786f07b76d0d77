#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <vector>

#include "records/listeners.h"

namespace plumb {

/// How fast a sender may be without loss to those who listen on this machine: UDP loses what finds
/// a listener's buffer full, and tells nobody. No more is sent than a buffer of the kernel's
/// default size (208 kB) holds, until all listeners have taken of it; and no more messages at once
/// than liblcm keeps, until they have dealt with them. Not thread-safe.
class Pacing {
 public:
  using Look = std::function<std::vector<Listener>()>;

  /// @param look at all listeners.
  explicit Pacing(Look look) : look_(std::move(look)) { LookAgain(); }

  /// @return whether a message of that size [bytes] may be sent now, and counts it as sent; if not,
  /// ask again in kNap.
  bool MaySend(size_t size);
  static constexpr int64_t kNap = 500;  ///< [us]
  /// A listener that takes nothing for so many naps stands still: it is not waited for until it
  /// goes on.
  static constexpr int kPatience = 10'000;
  /// One that is busy all the time, whatever it hears, is waited for so many naps.
  static constexpr int kWorkPatience = 100;

  /// Datagrams that listeners have lost since the construction, as of the last look.
  uint64_t Lost();
  /// Listeners that stand still.
  int standing_still() const;

 private:
  struct State {
    uint64_t drops;
    size_t waiting = 0;
    int naps = 0;  // in which it has taken nothing
  };
  void LookAgain();

  Look look_;
  std::map<uint64_t, State> listeners_;  // by their sockets
  size_t waiting_ = 0;                   // most of what was waiting at the last look
  size_t sent_ = 0;                      // since then, by what it costs in the kernel
  bool working_ = false;                 // somebody was, at the last look
  int burst_ = 0;                        // messages since nobody was
  int work_naps_ = 0;                    // in which somebody has been
  uint64_t lost_ = 0;
};

}  // namespace plumb
