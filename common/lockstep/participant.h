#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "common/clock.h"
#include "plumb/lockstep_post_t.hpp"

namespace plumb {

/// A process's place in a run in virtual time (docs/virtual-time.md). Time stands still while the
/// process works, and moves on in Wait, when everybody has done what was due. What it says and
/// hears goes through here, in one order that is the same in every run. Clock, Messenger and
/// OpenTransport know of it; other code need not. Not thread-safe, but for now() and time().
class Participant {
 public:
  enum class Wake {
    kWhenHeard,  ///< Wait ends early when something has been heard
    kOnTime,     ///< Wait lasts its time; messages that come meanwhile are there when it ends
  };

  virtual ~Participant() = default;

  /// The run's time [us], which is also the date as long as nobody has set the clock.
  int64_t now() const { return time_->now.load(std::memory_order_relaxed); }
  /// The same, for Clock.
  std::shared_ptr<const VirtualTime> time() const { return time_; }
  /// Whether it has been there from the run's first moment, and not been started again in the
  /// middle of it: then there is nothing that it could go on from.
  bool begins_run() const { return begins_run_; }

  /// From now on hears what others say on a bus, or anybody on a channel.
  virtual void Listen(const lockstep_topic_t& topic) = 0;
  /// Says something, which arrives after `way` >= 0 microseconds, zero meaning: still now.
  virtual void Say(const lockstep_topic_t& topic, std::vector<uint8_t> data, int64_t way = 0) = 0;
  /// Gives the others their turn. Ends at `until`, when something has been heard (if wanted), or
  /// when the process is asked to stop. @param stop_fd becomes readable when it is asked by a
  /// signal; -1: there is none.
  /// @param meanwhile is done while the others go on: work that says and hears nothing, and whose
  /// results are of `until`.
  /// @throws std::runtime_error if the run is over or cannot go on.
  virtual void Wait(int64_t until, Wake wake, int stop_fd = -1,
                    const std::function<void()>& meanwhile = {}) = 0;
  /// From now on this process's main thread works on the processor on which the coordinator does:
  /// handing over is much faster there than between two. For those whose turns are many and short.
  virtual void ShareProcessor() = 0;
  /// A line for whoever watches the run.
  virtual void Note(const std::string& line) = 0;
  /// The run cannot go on: everybody stops, and a person is told why.
  virtual void Fail(const std::string& why) = 0;
  /// Whether the run has asked this process to end.
  bool stopping() const { return stopping_; }

  /// LCM messages that have been heard, in order; the reader takes them out.
  std::deque<lockstep_post_t>& messages() { return messages_; }
  /// Frames that have been heard on a bus; the reader takes them out. The reference stays valid.
  std::deque<lockstep_post_t>& frames(const std::string& bus) { return frames_[bus]; }

 protected:
  Participant() = default;
  void SetNow(int64_t now) { time_->now.store(now, std::memory_order_relaxed); }
  void SetClockError(int64_t error) { time_->error.store(error, std::memory_order_relaxed); }
  void Hear(lockstep_post_t&& post);
  bool heard() const;

  bool stopping_ = false;
  bool begins_run_ = true;

 private:
  std::shared_ptr<VirtualTime> time_ = std::make_shared<VirtualTime>();
  std::deque<lockstep_post_t> messages_;
  std::map<std::string, std::deque<lockstep_post_t>> frames_;
};

lockstep_topic_t ChannelTopic(const std::string& channel);
lockstep_topic_t BusTopic(const std::string& url);

/// Joins the run that is coordinated at a path. @param name of this process. @return its place,
/// which it leaves when that is destroyed. @throws std::runtime_error, one line, if nobody is there
/// or the run will not have us.
std::unique_ptr<Participant> JoinRun(const std::string& path, const std::string& name);

}  // namespace plumb
