#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "drivers/can/frame.h"

namespace plumb {

class Participant;

/// Frames a transport lets in: those with (frame.id & mask) == (id & mask) and ids of that many
/// bits, classic and FD. Remote frames pass only with `remote`, error frames always.
struct Filter {
  static constexpr uint32_t kAllExtended = 0x1FFFFFFF;  ///< mask of one extended id

  uint32_t id;
  uint32_t mask = 0x7FF;
  bool remote = false;
  bool own = false;  ///< nobody but us may send these: another's are let in marked Frame::foreign
  bool extended = false;  ///< ids of 29 bits, else of 11
};

enum class LinkState {
  kUp,
  kDown,  ///< the interface is down; it may come up again
  kGone,  ///< the interface was removed (an adapter unplugged)
};

/// Counters since the transport was opened.
struct TransportStats {
  int64_t received = 0;   ///< frames handed out by Receive
  int64_t sent = 0;       ///< frames accepted by Send
  int64_t refused = 0;    ///< frames given to Send and not accepted: never sent later
  int64_t malformed = 0;  ///< input that is not a frame
  int64_t lost = 0;       ///< frames lost because we received too slowly
  int64_t echoes = 0;     ///< own frames seen on the bus
  int64_t foreign = 0;    ///< frames received that only we may send: there is a second master
  int64_t injected = 0;   ///< faults made by faulty:
};

/// A transport's part in a run in virtual time.
struct LockstepBus {
  Participant* participant = nullptr;  ///< null: there is no such run
  int64_t way = 0;                     ///< [us] that frames sent by this transport are on their way
  /// [0.1 s] of real time until a frame that has not arrived is lost
  int patience = 100;
};

/// A connection to a CAN bus. Send and Receive do not block, throw or allocate, but for loop: and
/// in virtual time, and one's own frames are not received. None waits by a clock of its own; where
/// frames wait for a time (faulty:, replay:), SetTime tells it and NextEvent says when to come
/// again. Not thread-safe.
class Transport {
 public:
  virtual ~Transport() = default;

  /// Readable when frames wait. Stays the same number for the transport's life, Reopen included. A
  /// frame that waits for a time does not show here.
  virtual int fd() const noexcept = 0;
  /// Tells the time; call it before Send and Receive. The same calls with the same times have the
  /// same outcome. It is scaled monotonic [us]; one before the latest counts as the latest.
  virtual void SetTime(int64_t) noexcept {}
  /// The time of SetTime at which a frame becomes due, in the past if one is; kNever: none waits
  /// for a time.
  virtual int64_t NextEvent() const noexcept { return kNever; }
  /// Sends the frames in order. @return how many were accepted; the rest is dropped and counted,
  /// because a command that waits is a stale command.
  virtual int Send(std::span<const Frame> frames) noexcept = 0;
  /// Takes up to frames.size() received frames. @return how many; 0 = none waits, or there is so
  /// much else (own frames, malformed ones) that looking on would take too long: fd() is readable
  /// still.
  virtual int Receive(std::span<Frame> frames) noexcept = 0;
  /// Tries to bring the link back; call it now and then while link() is not kUp. @return link()
  /// afterwards.
  virtual LinkState Reopen() noexcept { return link_; }
  /// True if what is received is a recording: no drive hears what is sent, so nothing must be
  /// armed.
  virtual bool is_replay() const noexcept { return false; }

  /// False if the interface is not set up for frames of CAN FD: it would refuse them.
  virtual bool carries_fd() const noexcept { return true; }

  LinkState link() const noexcept { return link_; }
  const TransportStats& stats() const noexcept { return stats_; }
  /// Faults found at opening that did not prevent it: one line each, with the cure.
  const std::vector<std::string>& warnings() const noexcept { return warnings_; }

  static constexpr int64_t kNever = std::numeric_limits<int64_t>::max();

 protected:
  explicit Transport(std::vector<Filter> filters) : filters_(std::move(filters)) {}
  /// True if the filters let the frame in. No filters: everything passes.
  bool Passes(const Frame& frame) const noexcept;
  /// True if the frame is one that only we may send.
  bool IsOurs(const Frame& frame) const noexcept;

  std::vector<Filter> filters_;
  std::vector<std::string> warnings_;
  LinkState link_ = LinkState::kUp;
  TransportStats stats_;
};

/// Opens a bus by URL:
///   socketcan:can0           Linux SocketCAN
///   udp:239.74.163.2:43113   UDP multicast on this machine (python-can's "udp_multicast" format,
///                            IPv4)
///   loop:name                in this process: all transports of one name hear each other
///   replay:run.log           a log of candump -l, or of python-can, in its own time; sends nothing
///   faulty:loss=0.1:URL      another bus with faults, see faulty.h
/// docs/transports.md says more of each.
/// @param run of a process that takes part in one: its bus is in virtual time, too, see
/// lockstep_transport.h.
/// @throws std::runtime_error: one line that names the cause and the cure.
std::unique_ptr<Transport> OpenTransport(const std::string& url, std::vector<Filter> filters = {},
                                         LockstepBus run = {});

}  // namespace plumb
