#pragma once

#include <memory>
#include <string>
#include <vector>

#include "drivers/can/transport.h"

namespace plumb {

/// Another bus with faults. The faults come first, separated by commas, then the other bus's URL:
///
///   faulty:loss=0.1,rx.delay=2ms,tx.full=0.01,seed=7:udp:239.74.163.2:43113
///
/// rx.NAME is about what is received, tx.NAME about what is sent, NAME alone about both. P is a
/// probability per frame, T a time such as 500us, 2ms, 1s.
///
///   loss=P       the frame vanishes; who sent it is not told
///   duplicate=P  it comes twice
///   reorder=P    it lets the next one pass
///   corrupt=P    one bit of its payload is wrong (on a real bus the checksum would not let it
///                through)
///   delay=T      it takes T
///   jitter=T     it takes up to T more, uniformly; frames keep their order
///   full=P       (tx) the transmit queue is full: this frame of a Send and those after it are
///                refused
///   errors=P     (rx) an error frame comes before it: not acknowledged, error-warning, -passive,
///                bad stuffing
///   busoff=P     (rx) the controller leaves the bus: an error frame says so, for 100 ms nothing is
///                received or accepted, and then another says that it is back
///   seed=N       of all the chance in this (1)
///
/// The same seed and the same calls with the same times have the same faults, and a fault that is
/// switched on does not change the luck of the others. Delays and bus-off need SetTime. Delayed
/// frames are not stamped (receive_ns = 0), as their arrival is when they are handed out.
/// @param faults_and_bus what follows "faulty:".
/// @throws std::runtime_error naming the fault that is not one; or what opening the other bus
/// throws. The transport is not thread-safe.
std::unique_ptr<Transport> OpenFaulty(const std::string& faults_and_bus,
                                      std::vector<Filter> filters, LockstepBus run = {});

}  // namespace plumb
