#pragma once

#include <limits>
#include <vector>

#include "common/config.h"

namespace plumb {

struct JointDescription;

/// [driver]: its periods and timeouts, how it stops, and the limits beyond which there is a fault.
struct DriverSettings {
  /// The efforts of the joints when a command has expired, until the driver disarms: none, the last
  /// one falling linearly to nothing within `ramp`, or -damping * velocity (JointLimitSettings).
  /// Faults and requests disarm at once, whatever this is.
  enum class Stop { kZero, kRamp, kDamping };

  /// [s], scaled time
  double cycle, measurement, expiry, disarm_after, stale_after, heartbeat_timeout, start_guard;
  double telemetry = 0.1;  ///< [s] at which each drive is asked for its temperatures and supply
  Stop stop = Stop::kZero;
  double ramp = 0;          ///< [s] > 0 of kRamp, else 0
  double effort_delay = 0;  ///< [s] 0 to 0.01, from a torque frame's transmission until it acts

  // Beyond these is a fault. A quantity that a drive does not report is not checked.
  double max_motor_temperature = 90, max_drive_temperature = 90;     ///< [degC]
  double min_bus_voltage = 0;                                        ///< [V]
  double max_bus_voltage = std::numeric_limits<double>::infinity();  ///< [V]
  /// [s] for which position and velocity may stay the same bit by bit under an effort; 0 = for
  /// ever. Off unless asked for: a joint that holds still on coarse codes, or leans against
  /// something, looks like a dead encoder.
  double stuck_after = 0;
};

/// Heartbeats that are expected of a drive within heartbeat_timeout: with an ODrive's 100 ms 0.5 s.
inline constexpr int kBeatsPerTimeout = 5;

/// [s] that drives have to confirm that they are idle when the driver ends: some do by their next
/// heartbeat only. Thread-safe.
double DisarmPatience(const DriverSettings& driver);

/// Thread-safe. @throws ConfigError
DriverSettings ReadDriver(Config config, const std::vector<JointDescription>& joints);

}  // namespace plumb
