#include "drivers/driver/position_watch.h"

namespace plumb {

PositionWatch::PositionWatch(const JointDescription& joint)
    : lower_(joint.lower),
      upper_(joint.upper),
      unit_(joint.type == JointDescription::Type::kPrismatic ? "m" : "rad") {}

// Without limits the margin is infinite, too, and nothing is beyond.
void PositionWatch::Look(double position) noexcept {
  position_ = position;
  const double margin = beyond_ ? 0 : kMargin * (upper_ - lower_);
  beyond_ = position < lower_ - margin || position > upper_ + margin;
}

Reason PositionWatch::Warning() const noexcept {
  Reason warning;
  if (!beyond_) return warning;
  warning.Set(
      "at {:.4g} {}, beyond its limit of {:.4g} {} in the URDF: is its zero, sign or gear ratio "
      "right?",
      position_, unit_, position_ < lower_ ? lower_ : upper_, unit_);
  return warning;
}

}  // namespace plumb
