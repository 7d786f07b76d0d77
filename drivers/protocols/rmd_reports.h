#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "common/special_numbers.h"
#include "drivers/protocols/motor.h"
#include "drivers/protocols/uptime_watch.h"

namespace plumb {

/// The latest reports of an RMD motor, and the sign that it has restarted. Pure logic; free of
/// exceptions and allocation. Not thread-safe.
class RmdReports {
 public:
  /// @param torque_constant [Nm/A] of the torque current.
  explicit RmdReports(double torque_constant) : torque_constant_(torque_constant) {}

  /// @param frame an answer of 8 bytes, and no echo. kEstimate for an angle that comes soon after a
  /// speed: position and velocity of one instant.
  FrameUse OnAnswer(const Frame& frame, int64_t now) noexcept;

  const MotorEstimate& estimate() const noexcept { return estimate_; }
  double torque_estimate() const noexcept { return torque_estimate_; }
  const MotorReadings& readings() const noexcept { return readings_; }
  std::string_view identity() const noexcept { return identity_.text(); }
  /// Error bits of the newest status.
  uint32_t errors() const noexcept { return errors_; }
  /// [ms] for which it has been up, if that began anew since its uptime before: it has lost its
  /// power, and maybe its place. Told once.
  std::optional<uint32_t> TakeRestart() noexcept { return uptime_.TakeRestart(); }

 private:
  void Identify() noexcept;
  void OnMotion(const FieldValues& values, int64_t now) noexcept;
  void OnStatus(const FieldValues& values, int64_t now) noexcept;

  const double torque_constant_;
  MotorEstimate estimate_;
  bool speed_known_ = false;  // since the last angle
  int64_t speed_at_ = 0;
  double torque_estimate_ = kNaN;
  MotorReadings readings_;
  uint32_t errors_ = 0;
  uint32_t version_ = 0;
  std::array<char, 7> model_{};
  Reason identity_;
  UptimeWatch uptime_{500'000};  // [us]
};

}  // namespace plumb
