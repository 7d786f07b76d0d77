#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string_view>

#include "common/seal.h"

namespace plumb {

/// What time it is in the run that is heard, how fast it goes, and of what kind it is: as its
/// messages say. Not thread-safe.
class RunTime {
 public:
  enum class Kind { kReal, kVirtual, kReplay };

  /// @param known of what kind it is, if somebody who started it has said so.
  explicit RunTime(std::optional<Kind> known = {}) : known_(known) {}

  /// A message whose utime is the time of saying; one that is no time is passed over.
  /// @param date of seals [us]. @param now monotonic [us].
  void OnMessage(int64_t utime, const std::optional<Seal>& seal, int64_t date, int64_t now);
  /// The run has been set back: it is as late as that again [us].
  void Rewind(int64_t utime);

  /// The latest such time [us], 0 before the first.
  int64_t utime() const { return utime_; }
  Kind kind() const { return known_.value_or(heard_); }
  std::string_view kind_name() const;
  /// Seconds of the run per second, over the last kWindow. @param now monotonic [us].
  double Speed(int64_t now);

 private:
  static constexpr int64_t kWindow = 2'000'000, kStep = 100'000;  // [us]
  struct Moment {
    int64_t now, utime;
  };
  const std::optional<Kind> known_;
  Kind heard_ = Kind::kReal;
  int64_t utime_ = 0;
  std::deque<Moment> moments_;  // a kStep apart at least
};

}  // namespace plumb
