#pragma once

#include <sched.h>
#include <sys/types.h>

#include <chrono>
#include <set>

namespace plumb {

/// Keeps the calling thread and other processes' main threads, who work one at a time, on one
/// processor: waking somebody on another one takes ten times as long where that has fallen asleep,
/// as virtual machines' do. Moves all of them to another one where that has more room. Errors are
/// of no consequence. Not thread-safe.
class SharedProcessor {
 public:
  SharedProcessor();
  /// Lets everybody go.
  ~SharedProcessor();
  SharedProcessor(const SharedProcessor&) = delete;
  SharedProcessor& operator=(const SharedProcessor&) = delete;

  void Add(pid_t pid);
  void Remove(pid_t pid);
  /// Somebody who is not to share it, though its parent does.
  void Release(pid_t pid) const;
  /// Call now and then, about every tenth of a second.
  void Balance();

 private:
  void Choose(int processor);

  cpu_set_t allowed_;   // to us, when we began
  int processor_ = -1;  // shared; -1: none, as there is nobody else
  pid_t self_;
  std::set<pid_t> others_;
  std::chrono::steady_clock::time_point looked_{};
  long long waited_ = 0;  // [ns] by this thread, ready to run, at the last look
};

}  // namespace plumb
