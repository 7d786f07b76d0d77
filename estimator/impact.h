#pragma once

#include <algorithm>
#include <cmath>

namespace plumb {

/// Speeds at which a robot may hit the ground or its stops, by kinematics alone; 0 = it does not.
/// An impact's force is roughly proportional to that speed (at first it is the damping's alone, and
/// at rest it is gone), so the uncertainty of the acceleration's step is, too. Masses and forces do
/// not enter, so that calibration may use states estimated like this. Functions here are
/// thread-safe.
struct ImpactSpeeds {
  double ground = 0;  ///< [m/s] of a point with the ground
  double stop = 0;    ///< [rad/s] or [m/s] of joints with their stops
};

/// An impact may be early or late by this: so are readings, and the velocity on the way to it is
/// not exact.
inline constexpr double kImpactTiming = 1e-3;  ///< [s]
/// Time in which an impact fades: its force outlasts its speed.
inline constexpr double kImpactFades = 5e-3;   ///< [s]
inline constexpr double kGroundMargin = 2e-3;  ///< [m]
inline constexpr double kStopMargin = 5e-3;    ///< [rad] or [m]

/// Speed of a coordinate x with velocity v if it is at most at `lower`, or will be within `ahead`
/// [s] and the timing, 0 otherwise.
inline double SpeedBelow(double lower, double margin, double x, double v, double ahead) {
  const double nearest = std::min(x, x + v * (ahead + kImpactTiming));
  return nearest < lower + margin ? std::abs(v) : 0;
}

/// The same of a joint with its stops; none if lower >= upper.
inline double StopSpeed(double lower, double upper, double q, double v, double ahead) {
  if (!(lower < upper)) return 0;
  return std::max(SpeedBelow(lower, kStopMargin, q, v, ahead),
                  SpeedBelow(-upper, kStopMargin, -q, -v, ahead));
}

}  // namespace plumb
