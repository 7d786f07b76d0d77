#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>
#include <vector>

namespace plumb {

/// Times in microseconds, in no order.
using Times = std::vector<int64_t>;

/// One process per core that does nothing but use it, at ordinary priority, until this is
/// destroyed.
class Load {
 public:
  /// Call it before this process has threads or another scheduling policy: they are inherited.
  explicit Load(int processes);
  ~Load();
  Load(const Load&) = delete;
  Load& operator=(const Load&) = delete;

 private:
  std::vector<pid_t> burning_;
};

/// SCHED_FIFO of this priority for this thread and those it starts, until destroyed; 0 = as it was.
/// @throws std::runtime_error if the system refuses.
class Realtime {
 public:
  explicit Realtime(int priority);
  ~Realtime();
  Realtime(const Realtime&) = delete;
  Realtime& operator=(const Realtime&) = delete;
};

/// How late a loop that does nothing else wakes from ppoll, every millisecond at absolute
/// deadlines.
Times BareTimer(double seconds);

/// From sending an LCM message of a JOINT_STATE's size, one a millisecond, to the answer of a
/// process that only sends it back.
Times BarePingPong(double seconds, const std::string& lcm_url);

}  // namespace plumb
