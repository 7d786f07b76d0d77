#include "robot/settings/driver.h"

#include <algorithm>
#include <cmath>

#include "robot/joints.h"
#include "robot/settings/ranges.h"

namespace plumb {

double DisarmPatience(const DriverSettings& driver) {
  return std::max(0.3, 1.5 * driver.heartbeat_timeout / kBeatsPerTimeout);
}

DriverSettings ReadDriver(Config config, const std::vector<JointDescription>& joints) {
  DriverSettings s;
  s.cycle = config.Number("cycle", {1e-4, 1});
  s.measurement = config.Number("measurement", {1e-4, 1});
  s.expiry = config.Number("expiry", {1e-3, 1});
  s.disarm_after = config.Number("disarm_after", {1e-3, 10});
  s.stale_after = config.Number("stale_after", {1e-3, 1});
  s.heartbeat_timeout = config.Number("heartbeat_timeout", {1e-3, 10});
  s.start_guard = config.Number("start_guard", {0, 10});
  s.effort_delay = config.Number("effort_delay", {0, 0.01}, 0);
  s.telemetry = config.Number("telemetry", {1e-3, 10}, s.telemetry);
  s.stop = static_cast<DriverSettings::Stop>(config.Choice("stop", {"zero", "ramp", "damping"}, 0));
  if (s.stop == DriverSettings::Stop::kRamp) {
    s.ramp = config.Number("ramp", {1e-3, 10});
  } else if (config.Has("ramp")) {
    config.Fail("ramp", "is for stop = \"ramp\" only");
  }
  if (s.stop == DriverSettings::Stop::kDamping &&
      std::none_of(joints.begin(), joints.end(),
                   [](const auto& joint) { return joint.limits.damping > 0; })) {
    config.Fail("stop", "= \"damping\", but no joint has a damping in its [joint.limits]");
  }
  s.max_motor_temperature =
      config.Number("max_motor_temperature", {0, HUGE_VAL}, s.max_motor_temperature);
  s.max_drive_temperature =
      config.Number("max_drive_temperature", {0, HUGE_VAL}, s.max_drive_temperature);
  s.min_bus_voltage = config.Number("min_bus_voltage", kSaneNotNegative, s.min_bus_voltage);
  s.max_bus_voltage = config.Number("max_bus_voltage", {1e-3, HUGE_VAL}, s.max_bus_voltage);
  s.stuck_after = config.Number("stuck_after", {0, 3600}, s.stuck_after);
  if (s.expiry < 2 * s.cycle) config.Fail("expiry", "must be at least two cycles");
  if (s.disarm_after < s.expiry) config.Fail("disarm_after", "must not be shorter than expiry");
  if (s.stale_after < 2 * s.measurement)
    config.Fail("stale_after", "must be at least two measurement periods");
  // Rounded as the sum of two decimals may be.
  if (s.ramp > (s.disarm_after - s.expiry) * (1 + 1e-9)) {
    config.Fail("ramp",
                "must not be longer than disarm_after - expiry: the drives would be disarmed "
                "before its end");
  }
  if (!(s.min_bus_voltage < s.max_bus_voltage))
    config.Fail("min_bus_voltage", "must be below max_bus_voltage");
  config.Finish();
  return s;
}

}  // namespace plumb
