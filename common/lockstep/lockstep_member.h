#pragma once

#include <sys/types.h>

#include <cstdint>
#include <deque>
#include <limits>
#include <string>

#include "common/lockstep/packet_socket.h"
#include "common/lockstep/process_watch.h"
#include "plumb/lockstep_post_t.hpp"
#include "plumb/lockstep_report_t.hpp"

namespace plumb {

/// A participant of a run in virtual time as the run's Coordinator knows it. Times are the run's
/// [us]. Not thread-safe.
struct LockstepMember {
  /// No moment.
  static constexpr int64_t kNever = std::numeric_limits<int64_t>::max();

  enum class State {
    kAbsent,    ///< has left, or has been killed; its turn is kept for one of the same name
    kExpected,  ///< has been started
    kWorking,   ///< has its turn, or comes up
    kReported,  ///< its turn is over, and what it reports not yet made known
    kWaiting,
  };

  bool settled() const {
    return state == State::kAbsent || state == State::kReported || state == State::kWaiting;
  }
  /// Whether a message has arrived for it by then.
  bool heard(int64_t now) const { return !mail.empty() && mail.front().arrival <= now; }
  /// When it is due. @return kNever if nothing is due unless something is heard.
  int64_t NextMoment() const;
  /// Puts a message into its mail, behind those that arrive no later.
  void Put(const lockstep_post_t& post);

  std::string name;
  pid_t pid = 0;
  State state = State::kExpected;
  PacketSocket socket;
  ProcessWatch watch;
  lockstep_report_t report{};  ///< of its latest turn, while it is kReported
  int64_t grants = 0;          ///< turns that it has been given
  int64_t until = kNever;      ///< when its wait ends
  bool wakes = true;           ///< or when it hears something
  bool stop = false;           ///< is to be told to stop, or has been
  bool told = false;           ///< has been told to stop
  int64_t stalled_until = std::numeric_limits<int64_t>::min();
  int64_t clock_error = 0;           ///< of what it takes for the date
  std::deque<lockstep_post_t> mail;  ///< by time of arrival
};

}  // namespace plumb
