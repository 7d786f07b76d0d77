#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "common/lcm_log_reader.h"

namespace plumb {

/// Where in an LCM log what moment is. Its times rise but for a few that are late, as loggers have
/// them. Immutable, and so thread-safe.
class LogIndex {
 public:
  /// Reads the whole log once, its messages apart, and leaves the reader at its beginning.
  /// @param progress told the share that is done; may throw to break off.
  /// @throws std::runtime_error naming the file if it is damaged, or has no message.
  explicit LogIndex(LcmLogReader& log, const std::function<void(double)>& progress = {});

  int64_t begin() const { return begin_; }  ///< [us] time of the first message
  int64_t end() const { return end_; }      ///< [us] the latest time
  int64_t messages() const { return messages_; }
  /// Whether the last message was cut off, as a logger's that was killed.
  bool cut_off() const { return cut_off_; }
  /// Leaves the reader before the first message that is no earlier than `utime`, or at the end.
  void Seek(LcmLogReader& log, int64_t utime) const;

 private:
  struct Place {
    int64_t position;
    int64_t latest;  // time before it
  };
  std::vector<Place> places_;
  int64_t begin_ = 0, end_ = 0, messages_ = 0;
  bool cut_off_ = false;
};

}  // namespace plumb
