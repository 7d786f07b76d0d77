#pragma once

#include <cstdint>
#include <string_view>

#include "common/file_descriptor.h"

namespace plumb {

/// Tells the service manager that has started this process how it is, as sd_notify(3) does: by
/// datagrams to the socket that $NOTIFY_SOCKET names. Does nothing where there is none. Once
/// constructed it never blocks, throws or allocates. Not thread-safe.
class ServiceNotice {
 public:
  /// As the environment says; $WATCHDOG_USEC where it is meant for this process.
  ServiceNotice();

  /// The process is at its work: READY=1 the first time, from then on WATCHDOG=1 whenever half of
  /// the time has passed in which the manager wants to hear it.
  void Alive() {
    if (socket_.valid()) Tell();
  }
  /// It has been asked to stop and is about to: STOPPING=1, the first time.
  void Stopping();

 private:
  void Tell();
  void Say(std::string_view what);

  FileDescriptor socket_;  // connected to the manager's
  int64_t period_ = 0;     // [ns] of WATCHDOG=1; 0 = nobody waits for it
  int64_t next_ = 0;       // [ns] of CLOCK_MONOTONIC
  bool ready_ = false, stopping_ = false;
};

}  // namespace plumb
