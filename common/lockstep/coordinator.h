#pragma once

#include <poll.h>
#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "common/lockstep/lockstep_member.h"
#include "common/lockstep/packet_socket.h"
#include "common/lockstep/participant.h"
#include "common/lockstep/shared_processor.h"
#include "plumb/lockstep_report_t.hpp"

namespace plumb {

/// Keeps the time of a run in virtual time (docs/virtual-time.md). Participants take turns: whoever
/// has something due, or has heard something, may work while everybody else waits; always in the
/// same cyclic order, that of Expect, the owner of the coordinator last. When nobody has anything
/// left to do, time moves on to the next moment at which somebody has. So the same processes with
/// the same seeds say the same things in the same order, however fast the machine is and whatever
/// else it does.
///
/// It works while its owner waits, in the owner's thread: participant().Wait(). Not thread-safe.
class Coordinator {
 public:
  /// Time at which a run begins, utime [us]: any time will do, but always the same.
  static constexpr int64_t kBeginning = 1'700'000'000'000'000;
  /// [s] of real time in which a process neither answers nor computes, until the run is given up.
  static constexpr double kPatience = 60;

  /// @param path of the socket where processes join. An old one is replaced.
  /// @throws std::runtime_error if it cannot be made.
  explicit Coordinator(std::string path);
  ~Coordinator();
  Coordinator(const Coordinator&) = delete;
  Coordinator& operator=(const Coordinator&) = delete;

  /// For a process's flag --clock.
  std::string clock() const { return "virtual:" + path_; }
  /// The owner's own place in the run.
  Participant& participant();
  int64_t now() const;

  /// A process of that name has been started: time stands still until it has joined.
  void Expect(const std::string& name, pid_t pid);
  /// Asks a participant to end, as SIGTERM does, at this moment of the run.
  void Stop(const std::string& name);
  /// A fault: it has no turn for that long [us], whatever it hears.
  void Stall(const std::string& name, int64_t duration);
  /// A fault: from now on its clock is wrong by that much [us], what dates are made of; intervals
  /// are right. One that is started later has the right time.
  void SetClockError(const std::string& name, int64_t error);
  /// Waits, in real time, until a participant that was killed is gone: it is dead at this moment of
  /// the run.
  /// @return false if go_on has ended the wait.
  bool AwaitEnd(const std::string& name);
  /// Whether it is in the run, or is expected.
  bool present(const std::string& name) const;

  /// Virtual seconds that may pass in a second of real time, for somebody who looks on; 0 = as many
  /// as can be.
  double max_speed = 0;
  /// Called, in order, with all that is said, when it is said.
  std::function<void(const lockstep_post_t&, const std::string& speaker)> on_post =
      [](const auto&, const auto&) {};
  /// A fault on the way: called for each who listens to what is said, with that one's name ("" is
  /// the owner). Hears what it returns, by arrival: nothing, the same later, twice, something else.
  /// Without it everybody hears everything.
  using Way = std::function<std::vector<lockstep_post_t>(
      const lockstep_post_t&, const std::string& speaker, const std::string& listener)>;
  Way on_way;
  /// Called about every tenth of a second of real time while a participant is at work; false ends
  /// the wait.
  std::function<bool()> go_on = [] { return true; };
  /// Called with a line for people: somebody was refused, has left without a word, or makes no
  /// progress.
  std::function<void(const std::string&)> on_note = [](const auto&) {};

 private:
  class Owner;

  LockstepMember* Find(const std::string& name) const;
  LockstepMember& Seat(const std::string& name);
  void TakeTurns(int stop_fd);
  bool HasTurn(const LockstepMember& member) const;
  void Grant(LockstepMember& member);
  bool Settle(int stop_fd);
  void WatchProgress();
  bool MoveOn(int64_t moment, int stop_fd);
  bool Listen(int stop_fd, int timeout);
  void Admit(PacketSocket& stranger);
  void Read(LockstepMember& member, PacketSocket::When when);
  void Digest(LockstepMember& member);
  void Leave(LockstepMember& member);
  void AddListener(const lockstep_topic_t& topic, LockstepMember& member);
  void Route(const lockstep_post_t& post, const LockstepMember& speaker);

  std::string path_;
  PacketSocket listener_;
  std::unique_ptr<Owner> owner_;
  std::vector<std::unique_ptr<LockstepMember>> members_;  // in the order of their turns
  size_t turn_ = 0;  // place of the participant that worked last; members_.size(): the owner's
  std::map<std::string, std::vector<LockstepMember*>> listeners_;  // of each topic
  std::vector<PacketSocket> strangers_;  // who have not said yet who they are
  std::string failure_;
  SharedProcessor processor_;
  std::vector<uint8_t> buffer_;
  std::vector<pollfd> polled_;
  std::chrono::steady_clock::time_point next_glance_{};
  // before then max_speed does not let time move on
  std::chrono::steady_clock::time_point allowed_{};
};

}  // namespace plumb
