#include "drivers/driver/stop.h"

#include <algorithm>
#include <cmath>

namespace plumb {

double StoppingEffort(const DriverSettings& settings, double damping, double last, double elapsed,
                      double velocity) {
  double effort = 0;
  switch (settings.stop) {
    case DriverSettings::Stop::kZero:
      break;
    case DriverSettings::Stop::kRamp:
      if (elapsed < settings.ramp) effort = last * (1 - std::max(elapsed, 0.0) / settings.ramp);
      break;
    case DriverSettings::Stop::kDamping:
      effort = -damping * velocity;
      break;
  }
  return std::isfinite(effort) ? effort : 0;
}

}  // namespace plumb
