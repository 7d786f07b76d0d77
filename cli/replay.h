#pragma once

#include <string>

#include "common/process.h"
#include "records/log_player.h"

namespace plumb {

/// The flags of `plumb replay`.
struct ReplayFlags {
  std::string log;
  LogPlayer::Part part;
  double speed = 1;  ///< of the log's time; 0 = as fast as the listeners on this machine can
};

/// `plumb replay`: says on LCM what a log has, byte by byte, at the times that it has, until the
/// end or Ctrl-C; on a terminal keys pause, seek, and change the speed. Ends where a driver speaks:
/// no robot is to be moved by a recording.
/// @return exit status: 1 if a driver spoke or a listener on this machine has lost messages, 130 if
/// interrupted. Not thread-safe.
/// @throws std::runtime_error or std::invalid_argument, one line for people: a log that cannot be
/// read or is damaged; LCM that is in use by a run.
int Replay(Process& process, const ReplayFlags& flags);

/// Speeds that the keys + and - lead to: twice and half of what it is, between 1/64 and 64, and
/// never the other way where --speed was beyond these. 0 = as fast as possible. Thread-safe.
double Faster(double speed);
double Slower(double speed);

}  // namespace plumb
