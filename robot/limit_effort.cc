#include "robot/limit_effort.h"

#include <algorithm>
#include <cmath>

namespace plumb {
namespace {

/// 1 with a room of `band` or more before a limit, from there linearly to 0 at the limit, 0 beyond
/// it. Without a band the limit itself is still within.
double Fade(double room, double band) {
  if (room < 0) return 0;
  return room < band ? room / band : 1;
}

}  // namespace

std::optional<double> LimitEffort(double wish, const JointSituation& joint,
                                  const JointLimits& limits) {
  if (!std::isfinite(wish) || !std::isfinite(joint.position) || !std::isfinite(joint.velocity))
    return {};
  const double band = std::isfinite(limits.velocity) ? kVelocityBand * limits.velocity : 0;
  const double up = std::min(Fade(limits.upper - joint.position, limits.margin),
                             Fade(limits.velocity - joint.velocity, band));
  const double down = std::min(Fade(joint.position - limits.lower, limits.margin),
                               Fade(limits.velocity + joint.velocity, band));
  const double change =
      std::isfinite(limits.effort_rate) ? limits.effort_rate * joint.elapsed : HUGE_VAL;
  const double highest = std::min(limits.effort * up, std::max(joint.effort_sent, 0.0) + change);
  const double lowest = std::max(-limits.effort * down, std::min(joint.effort_sent, 0.0) - change);
  return std::clamp(wish, lowest, highest);
}

}  // namespace plumb
