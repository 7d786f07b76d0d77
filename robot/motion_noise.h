#pragma once

#include "robot/description.h"

namespace plumb {

/// The noise that the estimator assumes for a joint: that of [estimator], unless the sensor that
/// measures the joint or its [joint.estimator] gives another. An IMU adds its bias and, to joints
/// that slide under it, the noise of its accelerometer. Thread-safe.
/// @param joint index into robot.joints
EstimatorSettings EstimatorOf(const RobotDescription& robot, int joint);

}  // namespace plumb
