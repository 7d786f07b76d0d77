#pragma once

#include <Eigen/Core>

#include "robot/description.h"

namespace plumb {

/// How exactly the estimator's smoothed states are known at the times of control: standard deviations of (q,
/// v), physical units, 2 * velocities entries.
///
/// The steady state of a Kalman filter and Rauch-Tung-Striebel smoother (AIAA J. 3, 1965) of position,
/// velocity and acceleration with the description's [estimator] settings: measurements each driver period,
/// white jerk, and at each control step an acceleration step as the full effort of the joint may make it. A
/// joint without a motor is taken to be measured like the others. Thread-safe.
Eigen::VectorXd SmoothedNoise(const RobotDescription& robot);

}  // namespace plumb
