#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "common/special_numbers.h"
#include "drivers/protocols/moteus.h"
#include "drivers/protocols/motor.h"
#include "drivers/protocols/uptime_watch.h"

namespace plumb {

/// The latest answers of a moteus, and the sign that it has restarted. Pure logic; free of
/// exceptions and allocation. Not thread-safe.
class MoteusReports {
 public:
  /// @param frame from the motor. kEstimate for an answer to kQuestion; kNotFinite for one without
  /// a position; kConsumed for another that is known; kRejected for all else, of which nothing is
  /// kept.
  FrameUse OnFrame(const Frame& frame, int64_t now) noexcept;

  /// What was learnt before is forgotten: the next motor of this id may be another.
  void ForgetSettings() noexcept;

  const MotorEstimate& estimate() const noexcept { return estimate_; }
  double torque_estimate() const noexcept { return torque_estimate_; }
  const MotorReadings& readings() const noexcept { return readings_; }
  std::string_view identity() const noexcept { return identity_.text(); }
  int64_t answers() const noexcept {
    return answers_;
  }                                              ///< to kQuestion, with a position or without
  int mode() const noexcept { return mode_; }    ///< moteus::Mode
  int fault() const noexcept { return fault_; }  ///< 0 = none, and nothing limits it either
  /// Register map, since ForgetSettings.
  std::optional<int> register_map() const noexcept { return register_map_; }
  /// servo.timeout_mode, since ForgetSettings: what it does without commands. -1: it said something
  /// else than a number.
  std::optional<int> timeout_mode() const noexcept { return timeout_mode_; }
  /// [ms] for which it has its power, if that began anew since the answer before. Told once.
  std::optional<uint32_t> TakeRestart() noexcept { return uptime_.TakeRestart(); }

 private:
  FrameUse OnAnswer(const FieldValues& values, int64_t now) noexcept;
  FrameUse OnText(const Frame& frame) noexcept;

  MotorEstimate estimate_;
  double torque_estimate_ = kNaN;
  MotorReadings readings_;
  int64_t answers_ = 0;
  int mode_ = moteus::kStopped, fault_ = 0;
  std::optional<int> register_map_, timeout_mode_;
  Reason identity_;
  UptimeWatch uptime_{1'000'000};  // [us]
};

}  // namespace plumb
