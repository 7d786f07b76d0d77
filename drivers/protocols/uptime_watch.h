#pragma once

#include <cstdint>
#include <optional>
#include <utility>

namespace plumb {

/// Finds out from a drive's own uptime that it has begun anew: it has lost its power, and maybe its
/// place. Not thread-safe; does not allocate.
class UptimeWatch {
 public:
  /// @param slack [us] by which its clock may be behind ours, frames that waited for us included;
  /// beside it a hundredth of the time between two answers.
  explicit UptimeWatch(int64_t slack) : slack_(slack) {}

  /// @param uptime [ms] that it tells; goes round after 50 days. @param now [us]
  void OnUptime(uint32_t uptime, int64_t now) noexcept {
    if (newest_) {
      const int64_t passed = now - newest_->at;
      const auto expected = newest_->uptime + static_cast<uint32_t>(passed / 1000);
      const int64_t behind = int64_t{static_cast<int32_t>(expected - uptime)} * 1000;
      if (behind > slack_ + passed / kDrift) restart_ = uptime;
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
