#pragma once

#include <cstdint>
#include <string_view>

#include "plumb/joint_command_t.hpp"

namespace plumb {

/// The newest valid command and nothing else: commands are never queued. Does not allocate after
/// construction. Not thread-safe. Times: `now` scaled monotonic [us], `utime` scaled real time
/// [us].
class CommandInbox {
 public:
  /// @param expiry [us] after it was computed a command is void, or after it was taken where its
  /// date is ahead; a command may shorten but not lengthen it.
  CommandInbox(int num_joints, int64_t expiry);

  /// Forgets everything: the next command may have any plausible sequence number (a new
  /// controller).
  void Clear() noexcept;

  /// Takes a command if it has the right size, finite efforts, no infinite or negative gains, was
  /// computed no longer than an expiry from `utime`, and has a greater sequence number than the
  /// last one taken. A number that is too much greater is refused, too: it is no controller's next,
  /// and would make all later commands of the real one look old.
  /// @return false if not; the one before stays in force.
  bool Offer(const joint_command_t& command, int64_t now, int64_t utime) noexcept;
  /// Why the last command was refused; empty if none was since the last one taken.
  std::string_view refusal() const noexcept { return refusal_; }

  bool empty() const noexcept { return empty_; }
  /// `now` of the last command taken. Meaningless while empty.
  int64_t arrival() const noexcept { return arrival_; }
  /// `now` until which the last command taken holds. Meaningless while empty.
  int64_t expires() const noexcept { return expires_; }
  /// Whether the last command taken is part of an episode.
  bool in_episode() const noexcept { return !empty_ && command_.episode >= 0; }
  bool Expired(int64_t now) const noexcept { return empty_ || now > expires(); }

  /// Effort wished for a joint that is at a position and velocity (joint side): the feed-forward
  /// effort plus kp (target - position) plus kd (target - velocity) where gains and targets are
  /// given.
  double Effort(int joint, double position, double velocity) const noexcept;

 private:
  /// [us] for which a command may be obeyed.
  int64_t Life(const joint_command_t& command) const noexcept;
  /// Empty if the command may be taken.
  std::string_view Judge(const joint_command_t& command, int64_t utime) const noexcept;

  int num_joints_;
  int64_t expiry_;
  bool empty_ = true;
  int64_t arrival_ = 0, expires_ = 0;
  std::string_view refusal_;  ///< of a literal
  joint_command_t command_;
};

}  // namespace plumb
