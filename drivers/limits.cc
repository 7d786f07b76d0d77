#include "drivers/limits.h"

#include <algorithm>
#include <cmath>

namespace plumb {

std::optional<double> LimitEffort(double effort, double position, double velocity,
                                  const JointLimits& limits) {
  if (!std::isfinite(effort) || !std::isfinite(position) || !std::isfinite(velocity)) return {};
  double lowest = -limits.effort, highest = limits.effort;
  if (position > limits.upper || velocity > limits.velocity) highest = 0;
  if (position < limits.lower || velocity < -limits.velocity) lowest = 0;
  return std::clamp(effort, lowest, highest);
}

}  // namespace plumb
