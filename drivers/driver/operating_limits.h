#pragma once

#include "drivers/protocols/motor.h"
#include "robot/description.h"

namespace plumb {

/// Whether a drive's temperatures and supply are within DriverSettings' limits. What it does not
/// report is not judged. There is no hysteresis: a fault is left by a person's ARM, which is
/// refused as long as this says why.
/// @param why is set if not: the reading, and the limit by its key. Thread-safe.
bool WithinOperatingLimits(const MotorReadings& readings, const DriverSettings& settings,
                           Reason& why) noexcept;

/// Telemetry periods after which a drive that has reported temperatures counts as having stopped
/// to.
inline constexpr int kTelemetryPeriods = 10;

/// Whether a drive that has reported temperatures does so no more: a warning, for nobody watches
/// them now.
/// @param telemetry [us] DriverSettings::telemetry.
bool TelemetryIsStale(const MotorReadings& readings, int64_t telemetry, int64_t now) noexcept;

}  // namespace plumb
