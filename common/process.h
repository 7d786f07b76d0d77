#pragma once

#include <poll.h>

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/clock.h"
#include "common/lockstep/participant.h"
#include "common/messenger.h"
#include "common/name_lock.h"
#include "common/signature.h"

namespace CLI {
class App;
}

namespace plumb {

/// The frame of every Plumbline process: flags, a log, a clock, a stop signal, a connection to LCM.
/// Not thread-safe.
///
///   int main(int argc, char** argv) {
///     return plumb::Run("plumb-estimator", "what it does", argc, argv,
///                       [&](CLI::App& app) { app.add_option(...); },
///                       [&](plumb::Process& process) { ...; return 0; });
///   }
class Process {
 public:
  /// @param clock SCALE, `SCALE@EPOCH`, or virtual:PATH of a coordinator. @throws std::exception if
  /// it is none of these, or nobody keeps time there.
  Process(std::string name, const std::string& lcm_url, const std::string& clock);
  /// Signs what is said, and believes what is signed. Before the first use of messenger().
  /// @throws std::runtime_error if the key cannot be used.
  void UseKey(const std::string& file);
  /// File of the key; empty = there is none.
  const std::string& key_file() const { return key_file_; }
  /// Without a key: takes part in a run (see Identity) of that number; 0 = in none. Before the
  /// first use of messenger().
  void TakePart(int64_t run) { run_ = run; }

  const std::string& name() const { return name_; }
  const Clock& clock() const { return clock_; }
  /// Opens LCM on first use. @throws std::runtime_error with the cure.
  Messenger& messenger();
  const std::string& lcm_url() const { return lcm_url_; }
  /// The place in a run in virtual time; null if there is none.
  Participant* participant() { return participant_; }
  /// Whether this is the beginning of a run in virtual time, which comes to the same whatever an
  /// earlier life of it has left; not so for who is started again in the middle.
  bool begins_virtual_run() const { return participant_ && participant_->begins_run(); }
  /// From now on takes part in a run whose coordinator lives in this process. Before the first use
  /// of messenger().
  void Enter(Participant& participant);

  /// Becomes readable when the process is asked to stop (SIGINT, SIGTERM, SIGHUP). For ppoll.
  int stop_fd() const { return stop_fd_; }
  /// From now on a stop signal, and one that has come already, ends the process at once, with exit
  /// status 130: for what does not look whether it is to stop, and leaves whole files or none.
  void EndAtOnce();
  /// True once the process has been asked to stop. Never blocks.
  bool stopping();
  /// Sleeps until LCM has messages, one of `fds` (which may be -1) is readable, the process is
  /// asked to stop, or `timeout` scaled microseconds have passed. Then drains LCM. @return false
  /// when the process is asked to stop. In virtual time `fds` are transports', whose frames the
  /// participant hears.
  bool Wait(int64_t timeout, std::span<const int> fds = {});
  /// The same, and leaves LCM's messages for messenger().Drain().
  void Doze(int64_t timeout, std::span<const int> fds = {});
  /// Sleeps for `timeout` scaled microseconds or until the process is asked to stop, whatever comes
  /// meanwhile. Then drains LCM. For those who are in no hurry. @param meanwhile work to do in that
  /// time, which sends and reads no message; in virtual time the others need not wait for it.
  /// @return false when the process is asked to stop.
  bool Sleep(int64_t timeout, const std::function<void()>& meanwhile = {});
  /// From here on no other program of this name can be there for this robot on this machine's LCM
  /// group: who says a channel is alone in that. In virtual time a run is, anyway.
  /// @throws std::runtime_error if another is there already.
  void BeAlone(const std::string& robot);
  /// From here on this process belongs to the fast loop. @param priority for BecomeRealtime; in
  /// virtual time there are no priorities, but its turns are to be short.
  void BecomeFast(int priority);
  /// A computation has been done that is to take that long [s] in virtual time, in which
  /// computations take none. Does nothing otherwise. Leaves LCM's messages for messenger().Drain().
  void TakeVirtualTime(double seconds);

 private:
  void Hear();

  std::string name_;
  std::string lcm_url_;
  std::string key_file_;
  std::optional<SigningKey> key_;
  int64_t run_ = 0;
  int stop_fd_;
  bool stopping_ = false;
  std::unique_ptr<Participant> joined_;  // to a coordinator in another process
  Participant* participant_;
  Clock clock_;
  std::unique_ptr<Messenger> messenger_;
  std::optional<NameLock> alone_;
  std::vector<pollfd> polled_;  // keeps its memory from call to call
};

/// "plumb-driver 1.0.0 (3f2a9c1, clean)"
std::string VersionLine(const std::string& name);

/// Parses the flags (the common ones and `add_flags`), starts the log, blocks the stop signals,
/// runs `body`, and turns any exception into one clear line and exit status 1. Usage errors exit
/// with 2. What was printed and could not be written is an error, too, unless it is that nobody
/// reads a pipe any more. Of the log's lines that are alike, whoever provokes them, no more are
/// written than LogLimit lets through.
int Run(const std::string& name, const std::string& description, int argc, char** argv,
        const std::function<void(CLI::App&)>& add_flags, const std::function<int(Process&)>& body);

}  // namespace plumb
