#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "common/special_numbers.h"
#include "drivers/protocols/cansimple.h"
#include "drivers/protocols/motor.h"

namespace plumb {

/// The latest reports of an ODrive, but for heartbeats and errors; and the signs that it has
/// restarted. Pure logic; free of exceptions and allocation. Not thread-safe.
class CanSimpleReports {
 public:
  /// @param frame of the drive's id, not remote. kRejected for what is too short, unknown or
  /// not finite, but for a temperature that has never been a number; kNotFinite for encoder
  /// estimates that are not.
  FrameUse OnFrame(const Frame& frame, int64_t now) noexcept;
  /// Call it with each heartbeat.
  void OnHeartbeat(int axis_state, int64_t now) noexcept;

  const MotorEstimate& estimate() const noexcept { return estimate_; }
  double torque_estimate() const noexcept { return torque_estimate_; }
  const MotorReadings& readings() const noexcept { return readings_; }
  std::string_view identity() const noexcept { return identity_.text(); }

  struct Firmware {
    int major, minor;
  };
  /// Nothing until it has said so, or since it was forgotten.
  const std::optional<Firmware>& firmware() const noexcept { return firmware_; }
  void ForgetFirmware() noexcept { firmware_.reset(); }

  /// True if frames with two serial numbers have come from one node: two drives that both obey us.
  bool two_drives() const noexcept { return two_drives_; }

  /// See Motor::Displaced.
  void Displaced() noexcept { estimated_ = away_.seen = false; }

  struct Restart {
    int64_t silence;  ///< [us] between two heartbeats
    /// [turns] of the position; nothing = it is zero, as it was before
    std::optional<double> jump;
  };
  /// Heartbeats stayed away, then said IDLE, and about that time the position jumped farther than
  /// it can have turned, or estimates stayed away, too, for as long as a drive takes to start, and
  /// the position is zero, as after a start: the drive lost its power, and with it its place. Told
  /// once.
  std::optional<Restart> TakeRestart() noexcept;

 private:
  FrameUse OnVersion(const FieldValues& values) noexcept;
  FrameUse OnAddress(const FieldValues& values) noexcept;
  FrameUse OnTemperatures(const FieldValues& values, int64_t now) noexcept;
  FrameUse OnEstimates(const FieldValues& values, int64_t now) noexcept;
  void LookForRestart() noexcept;

  MotorEstimate estimate_;
  double torque_estimate_ = kNaN;
  MotorReadings readings_;
  Reason identity_;
  std::optional<Firmware> firmware_;
  std::optional<double> serial_number_;
  bool two_drives_ = false;

  bool estimated_ = false;  // since it was switched on or displaced
  int64_t estimated_at_ = 0;
  int64_t heartbeat_ = 0, interval_ = 0;  // time of the last one; to the one before; 0 = not known
  struct Event {
    int64_t at = 0;
    double size = 0;
    bool seen = false;
  };
  // heartbeats that stayed away, estimates that did, and a jump of the position
  Event silence_, away_, jump_;
  std::optional<Restart> restart_;
};

}  // namespace plumb
