#pragma once

#include "robot/description.h"

namespace plumb {

/// The effort [Nm] or [N] on a joint whose command has expired, until commands come again or the
/// driver disarms, by DriverSettings::stop. Not yet limited. Zero if anything it needs is not
/// finite. Thread-safe.
/// @param damping [Nm s/rad] or [N s/m] JointLimitSettings::damping.
/// @param last [Nm] or [N] the effort last sent for a command.
/// @param elapsed [s] >= 0 since the command expired.
/// @param velocity [rad/s] or [m/s] measured.
double StoppingEffort(const DriverSettings& settings, double damping, double last, double elapsed,
                      double velocity);

}  // namespace plumb
