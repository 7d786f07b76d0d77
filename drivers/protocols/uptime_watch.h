#pragma once

#include <cstdint>
#include <optional>
#include <utility>

namespace plumb {

/// Finds out from a drive's own uptime that it has begun anew: it has lost its power, and maybe its
/// place. Either it is less than it should be, or, after more than 25 days, when the difference has
/// gone round, it is no longer than the time since the answer before. Not thread-safe; does not
/// allocate.
class UptimeWatch {
 public:
  /// @param slack [us] by which its clock may be behind ours, frames that waited for us included;
  /// beside it a hundredth of the time between two answers.
  explicit UptimeWatch(int64_t slack) : slack_(slack) {}

  /// @param uptime [ms] that it tells; goes round after 50 days. @param now [us]
  void OnUptime(uint32_t uptime, int64_t now) noexcept {
    if (newest_) {
      const int64_t passed = now - newest_->at;
      const auto behind = newest_->uptime + static_cast<uint32_t>(passed / 1000) - uptime;  // [ms]
      const int64_t slack = slack_ + passed / kDrift;
      const bool less = int64_t{static_cast<int32_t>(behind)} * 1000 > slack;
      const bool since = int64_t{behind} * 1000 > slack && int64_t{uptime} * 1000 <= passed;
      if (less || since) restart_ = uptime;
    }
    newest_ = {uptime, now};
  }
  /// [ms] for which it has been up, if that began anew since its uptime before. Told once.
  std::optional<uint32_t> TakeRestart() noexcept { return std::exchange(restart_, std::nullopt); }

 private:
  static constexpr int64_t kDrift = 100;
  struct Answer {
    uint32_t uptime;  // [ms]
    int64_t at;
  };
  int64_t slack_;
  std::optional<Answer> newest_;
  std::optional<uint32_t> restart_;
};

}  // namespace plumb
