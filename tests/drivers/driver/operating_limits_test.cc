#include "drivers/driver/operating_limits.h"

#include <catch2/catch.hpp>

#include "common/special_numbers.h"

namespace plumb {
namespace {

using Catch::Matchers::Equals;

TEST_CASE("temperatures and supply have limits") {
  DriverSettings settings{};
  MotorReadings readings;
  Reason why;
  CHECK(WithinOperatingLimits(readings, settings, why));  // nothing is reported
  readings = {.motor_temperature = 90, .drive_temperature = 90, .bus_voltage = 0};
  CHECK(WithinOperatingLimits(readings, settings, why));
  CHECK(why.text().empty());

  const auto complaint = [&](double motor, double drive, double voltage) {
    readings = {.motor_temperature = motor, .drive_temperature = drive, .bus_voltage = voltage};
    CHECK_FALSE(WithinOperatingLimits(readings, settings, why));
    return std::string(why.text());
  };
  CHECK_THAT(complaint(90.5, 20, 24),
             Equals("the motor has 90.5 degC, more than max_motor_temperature = 90"));
  CHECK_THAT(complaint(kNaN, 91, 24),
             Equals("the drive has 91.0 degC, more than max_drive_temperature = 90"));
  settings.min_bus_voltage = 20;
  settings.max_bus_voltage = 28.5;
  CHECK_THAT(complaint(20, 20, 19.9),
             Equals("its supply has 19.9 V, less than min_bus_voltage = 20"));
  CHECK_THAT(complaint(20, 20, 30),
             Equals("its supply has 30.0 V, more than max_bus_voltage = 28.5"));
  readings.bus_voltage = kNaN;
  CHECK(WithinOperatingLimits(readings, settings, why));
}

TEST_CASE("who has reported temperatures is expected to go on") {
  MotorReadings readings;
  CHECK_FALSE(TelemetryIsStale(readings, 100'000, 1'000'000'000));  // never did
  readings.drive_temperature = 30;
  readings.temperatures_at = 5'000'000;
  CHECK_FALSE(TelemetryIsStale(readings, 100'000, 6'000'000));
  CHECK(TelemetryIsStale(readings, 100'000, 6'000'001));
}

}  // namespace
}  // namespace plumb
