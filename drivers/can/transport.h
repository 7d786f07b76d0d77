#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "drivers/can/frame.h"

namespace plumb {

/// Standard (11-bit) frames a transport lets in: those with (frame.id & mask) == (id & mask). Remote frames
/// pass only with `remote`; extended frames never do; error frames always do.
struct Filter {
  uint32_t id;
  uint32_t mask = 0x7FF;
  bool remote = false;
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
};

/// A connection to a CAN bus. Send and Receive do not block, throw or allocate, and one's own frames are not
/// received. Not thread-safe.
class Transport {
 public:
  virtual ~Transport() = default;

  /// Readable when frames wait. Stays the same number for the transport's life, Reopen included.
  virtual int fd() const noexcept = 0;
  /// Sends the frames in order. @return how many were accepted; the rest is dropped and counted, because a
  /// command that waits is a stale command.
  virtual int Send(std::span<const Frame> frames) noexcept = 0;
  /// Takes up to frames.size() received frames. @return how many; 0 = none waits, or there is so much else
  /// (own frames, malformed ones) that looking on would take too long: fd() is readable still.
  virtual int Receive(std::span<Frame> frames) noexcept = 0;
  /// Tries to bring the link back; call it now and then while link() is not kUp. @return link() afterwards.
  virtual LinkState Reopen() noexcept { return link_; }

  LinkState link() const noexcept { return link_; }
  const TransportStats& stats() const noexcept { return stats_; }

 protected:
  explicit Transport(std::vector<Filter> filters) : filters_(std::move(filters)) {}
  /// True if the filters let the frame in. No filters: everything passes.
  bool Passes(const Frame& frame) const noexcept;

  std::vector<Filter> filters_;
  LinkState link_ = LinkState::kUp;
  TransportStats stats_;
};

/// Opens a bus by URL:
///   socketcan:can0           Linux SocketCAN
///   udp:239.74.163.2:43113   UDP multicast on this machine (python-can's "udp_multicast" format, IPv4)
///   loop:name                in this process: all transports of one name hear each other
/// @throws std::runtime_error: one line that names the cause and the cure.
std::unique_ptr<Transport> OpenTransport(const std::string& url, std::vector<Filter> filters = {});

}  // namespace plumb
