#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cstdint>
#include <string_view>

#include "plumb/driver_status_t.hpp"

namespace plumb {

/// How long the phases of the driver's cycle take: histograms in powers of two of microseconds, as
/// DRIVER_STATUS has them. Mark and End do not allocate. Not thread-safe.
class PhaseTimes {
 public:
  enum Phase : size_t {
    kReceive,  ///< frames from the bus to the state machine
    kPublish,  ///< JOINT_STATE and IMU
    kCommand,  ///< messages from LCM, JOINT_COMMAND among them
    kControl,  ///< checks and efforts
    kSend,     ///< frames to the bus
  };
  static constexpr std::array<std::string_view, 5> kNames = {"receive", "publish", "command",
                                                             "control", "send"};
  static constexpr size_t kBins = 20;  ///< the last one open

  /// Where [2^bin, 2^(bin + 1)) us belongs; below 1 us to bin 0.
  static size_t Bin(int64_t microseconds) noexcept {
    const auto positive = static_cast<uint64_t>(std::max<int64_t>(microseconds, 1));
    return std::min(static_cast<size_t>(std::bit_width(positive)) - 1, kBins - 1);
  }

  /// @param timed false: in virtual time, in which phases take none.
  explicit PhaseTimes(bool timed = true) : timed_(timed) {}

  /// A phase begins.
  void Mark() noexcept { mark_ = Now(); }
  /// It ends, and the next one begins.
  void End(Phase phase) noexcept {
    const Clock::time_point now = Now();
    ++counts_[phase]
             [Bin(std::chrono::duration_cast<std::chrono::microseconds>(now - mark_).count())];
    mark_ = now;
  }

  void Fill(driver_status_t& status) const {
    if (status.num_phases == 0) {
      status.num_phases = static_cast<int32_t>(kNames.size());
      status.phase_name.assign(kNames.begin(), kNames.end());
      status.phase_duration.assign(kNames.size(), std::vector<int64_t>(kBins));
    }
    for (size_t i = 0; i < kNames.size(); ++i)
      std::ranges::copy(counts_[i], status.phase_duration[i].begin());
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point Now() const noexcept { return timed_ ? Clock::now() : Clock::time_point{}; }

  bool timed_;
  Clock::time_point mark_;
  std::array<std::array<int64_t, kBins>, kNames.size()> counts_{};
};

}  // namespace plumb
