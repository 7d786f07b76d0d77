#include "drivers/driver/operating_limits.h"

#include <cmath>

namespace plumb {

// Comparisons with NaN, which stands for what is not reported, are false.
bool WithinOperatingLimits(const MotorReadings& readings, const DriverSettings& settings,
                           Reason& why) noexcept {
  if (readings.motor_temperature > settings.max_motor_temperature) {
    why.Set("the motor has {:.1f} degC, more than max_motor_temperature = {}",
            readings.motor_temperature, settings.max_motor_temperature);
  } else if (readings.drive_temperature > settings.max_drive_temperature) {
    why.Set("the drive has {:.1f} degC, more than max_drive_temperature = {}",
            readings.drive_temperature, settings.max_drive_temperature);
  } else if (readings.bus_voltage < settings.min_bus_voltage) {
    why.Set("its supply has {:.1f} V, less than min_bus_voltage = {}", readings.bus_voltage,
            settings.min_bus_voltage);
  } else if (readings.bus_voltage > settings.max_bus_voltage) {
    why.Set("its supply has {:.1f} V, more than max_bus_voltage = {}", readings.bus_voltage,
            settings.max_bus_voltage);
  } else {
    return true;
  }
  return false;
}

bool TelemetryIsStale(const MotorReadings& readings, int64_t telemetry, int64_t now) noexcept {
  const bool reported =
      !std::isnan(readings.motor_temperature) || !std::isnan(readings.drive_temperature);
  return reported && now - readings.temperatures_at > kTelemetryPeriods * telemetry;
}

}  // namespace plumb
