#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <string>

#include "common/lcm_log_reader.h"
#include "records/log_index.h"

namespace plumb {

/// Which message of an LCM log is due when, at a speed that may be changed, with pauses and jumps.
/// Knows no clock: `now` is any clock's time [us] that rises. Positions are seconds from the log's
/// beginning. Not thread-safe.
class LogPlayer {
 public:
  static constexpr double kToTheEnd = std::numeric_limits<double>::infinity();
  struct Part {
    double from = 0, to = kToTheEnd;  ///< [s]; a message at `to` belongs to it
    bool again = false;               ///< begins anew when it is over
  };

  /// Begins with the part's first message. @param speed of the log's time against `now`'s, >= 0; 0
  /// = every message is due at once. @param progress of looking through the file, as LogIndex's.
  /// @throws std::runtime_error naming the file if it cannot be read, is damaged, or has no message
  /// in the part.
  LogPlayer(const std::string& file, const Part& part, double speed, int64_t now,
            const std::function<void(double)>& progress = {});

  const LogIndex& index() const { return index_; }
  double duration() const { return At(index_.end()); }
  double speed() const { return speed_; }
  bool paused() const { return paused_; }
  /// All has been played: the part is not played again, and nothing is left of it.
  bool over() const { return over_; }

  /// The message whose turn it is; meaningless when it is over.
  const LcmLogEvent& next() const { return next_; }
  /// [us] of `now`'s time until it is due, <= 0: it is; a very long time while it is paused.
  int64_t Remaining(int64_t now) const;
  /// It has been said. @throws std::runtime_error if the file has changed and is damaged.
  void Advance(int64_t now);

  double Position(int64_t now) const;
  void Pause(bool pause, int64_t now);
  void SetSpeed(double speed, int64_t now);
  /// Goes to a position, or the nearest that the part has. What had been over goes on.
  void Seek(double position, int64_t now);

 private:
  double At(int64_t utime) const;
  void Read(int64_t now);

  LcmLogReader log_;
  const LogIndex index_;
  Part part_;
  double speed_;
  bool paused_ = false, over_ = false;
  LcmLogEvent next_;
  int64_t since_;        // of `now`, at which we were ...
  double since_at_ = 0;  // ... there
};

}  // namespace plumb
