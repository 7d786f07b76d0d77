#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "common/hash.h"
#include "plumb/lockstep_post_t.hpp"

namespace plumb {

/// What has been seen of a run: the newest of it to be told after a violation, a fingerprint of all
/// of it, and the first violation. Not thread-safe.
class Chronicle {
 public:
  static constexpr size_t kPranksTold = 12, kPostsTold = 24, kTurnsTold = 16;

  /// @param text with its time.
  void AddPrank(const std::string& text);
  /// Times are the run's [us].
  void AddPost(int64_t time, const lockstep_post_t& post, const std::string& speaker);
  /// Something of note: a state that has changed, a process that has ended.
  void AddTurn(int64_t time, const std::string& text);
  /// The first one counts.
  void Violate(int invariant, int64_t time, const std::string& text);

  bool violated() const { return violation_.has_value(); }
  int invariant() const { return invariant_; }  ///< that is violated; 0 = none
  /// The violation and what came before it, for people. Empty if there is none.
  std::string Story() const;
  /// Of all that was said, by whom and when.
  uint64_t fingerprint() const { return fingerprint_; }
  int64_t messages() const { return messages_; }
  int64_t frames() const { return frames_; }

 private:
  struct Said {
    int64_t time;
    std::string speaker;
    lockstep_topic_t topic;
    std::string data;  // a frame's text; of a message nothing
    size_t size;
  };

  std::deque<std::string> pranks_, turns_;
  std::deque<Said> posts_;
  std::optional<std::string> violation_;
  int invariant_ = 0;
  uint64_t fingerprint_ = kEmptyHash;
  int64_t messages_ = 0, frames_ = 0;
};

}  // namespace plumb
