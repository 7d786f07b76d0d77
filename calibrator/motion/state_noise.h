#pragma once

#include <Eigen/Core>

#include "robot/description.h"

namespace plumb {

/// How exactly the estimator's smoothed states are known at the times of control: standard
/// deviations of (q, v), physical units, 2 * velocities entries.
///
/// The steady state of a Kalman filter and Rauch-Tung-Striebel smoother (AIAA J. 3, 1965) of
/// position, velocity and acceleration with the settings that the estimator has for each joint
/// (EstimatorOf): measurements each driver period, white jerk, and at each control step an
/// acceleration step as the joints' full efforts may make it. An IMU's accelerometer and impacts
/// are left out. Thread-safe.
Eigen::VectorXd SmoothedNoise(const RobotDescription& robot);

}  // namespace plumb
