#pragma once

#include <algorithm>
#include <cmath>

namespace plumb {

/// How fast a robot meets what it hits, as far as kinematics tells; 0 = it does not. An impact's
/// force is roughly proportional to that speed (all of it is the damping's where something is hit,
/// and gone where it rests), so the acceleration's step is left open in proportion. Masses and
/// forces do not enter: calibration may use what comes of it. Functions here are thread-safe.
struct ImpactSpeeds {
  double ground = 0;  ///< [m/s] of a point with the ground
  double stop = 0;    ///< [rad/s] or [m/s] of joints with their stops
};

/// By how much an impact may be early or late: readings are, and the way to it is only as well
/// known as the velocity.
inline constexpr double kImpactTiming = 1e-3;  ///< [s]
/// In which what is left of an impact fades: its force outlasts its speed.
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
