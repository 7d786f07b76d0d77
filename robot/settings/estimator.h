#pragma once

#include "common/config.h"
#include "common/special_numbers.h"

namespace plumb {

struct RobotDescription;

/// [estimator]: the noise that the estimator assumes for a joint without settings of its own (see
/// EstimatorOf), in [m] instead of [rad] where the joint slides, and the settings of its filters.
struct EstimatorSettings {
  double position_sd;  ///< [rad] of a reading
  double velocity_sd;  ///< [rad/s]
  double jerk;         ///< [rad/s^3 sqrt(s)]
  double effort_step;  ///< [rad/s^2 per Nm]
  /// sd of the acceleration's step per speed of an impact: of a point with the ground [rad/s^2 per
  /// m/s], of a joint with its stop [rad/s^2 per rad/s]
  double ground_impact = 0, stop_impact = 0;
  /// of a joint with a motor: share of an effort's or a stop's effect that others' have, 0 to 1
  double coupling = 1;
  double timing_sd;    ///< [s]
  int lag;             ///< [measurements]
  double reset_after;  ///< [rad]
  /// [s] of a reading on its way: the constant part, which arrivals cannot tell
  double delay = 0;
  double outage = 0.05;  ///< [s] that a silent joint is predicted before the state is invalid
  /// [rad/s^2 sqrt(s)] spectral density^(1/2) of what the accelerations differ by from the
  /// simulator's, of the filter on its dynamics: [estimator.model]
  double model_acceleration = 0.2;
  /// Sensors of the base's joints: their own, as all other joints have them, or, of a free
  /// base, its IMU and its legs.
  enum class Base { kSensors, kLegs };
  Base base = Base::kSensors;
  double ground_sd = 5e-3;  ///< [m] of kLegs: by which the ground is uneven and gives way
  double slip = 0.01;  ///< [m/sqrt(s)] of kLegs: by which a foot that rests creeps, each its way
  /// [m/s] of kLegs: at which all feet that rest may creep the same way, which nothing sees
  double creep = 0;
  // Of an IMU on a link that the joint carries; 0: there is none.
  /// [m/s^2] of a slide's acceleration, averaged over a period of the IMU
  double acceleration_sd = 0;
  /// [rad/s] of the gyro, if the joint turns, or [m/s^2] of the accelerometer
  double bias_sd = 0;
};

/// A joint's or a sensor's own noise in robot.toml; NaN = not given. Units as in EstimatorSettings.
struct NoiseDescription {
  double position_sd = kNaN;
  double velocity_sd = kNaN;
  double jerk = kNaN;
  double effort_step = kNaN;
  double ground_impact = kNaN;
  double stop_impact = kNaN;
  double coupling = kNaN;
  double delay = kNaN;
};

/// @param robot with links, joints, sensors and simulation. Thread-safe. @throws ConfigError
EstimatorSettings ReadEstimator(Config config, const RobotDescription& robot);

}  // namespace plumb
